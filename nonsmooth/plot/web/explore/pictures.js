// The pictures of the page of a system: portrait or orbit in space, time series, cloud of a sweep.
"use strict";

const Pictures = (() => {
  const { svg, html, text, Plane } = Page;
  const isPhone = () => innerWidth < 900;

  /** A class of lines for each mode: sides of a surface, sliding, and three for others. */
  class Modes {
    others = [];

    of(mode) {
      const [letters] = mode.split(",");
      if (mode.includes(",")) return this.further(mode);
      if (/^[+o]*$/.test(letters)) return "mode-above";
      if (/^-+$/.test(letters)) return "mode-below";
      if (/^[sc*]+$/.test(letters)) return "mode-slide";
      return this.further(mode);
    }

    further(mode) {
      if (!this.others.includes(mode)) this.others.push(mode);
      return `mode-${3 + (this.others.indexOf(mode) % 3)}`;
    }
  }

  /** What a path draws through points of a plane, to a tenth of a pixel. */
  function drawn(plane, points) {
    const { left, top, width, height } = plane.box;
    const [a, b] = plane.x;
    const [c, d] = plane.y;
    const near = (v) => Math.round(Math.min(Math.max(v, -1e5), 1e5) * 10) / 10;
    return points
      .map(([u, v], k) => {
        const x = near(left + ((u - a) * width) / (b - a));
        const y = near(top + height - ((v - c) * height) / (d - c));
        return `${k ? "L" : "M"}${x} ${y}`;
      })
      .join("");
  }

  /** Paths of pieces, one for each class. */
  function byClass(pieces, classOf, pathOf) {
    const paths = new Map();
    for (const piece of pieces) {
      const name = classOf(piece);
      paths.set(name, (paths.get(name) ?? "") + pathOf(piece));
    }
    return paths;
  }

  /** The plane of a system with one or two states, and the projection of one with more. */
  class Portrait {
    constructor(element, engine, given, modes, redraw) {
      const margin = isPhone() ? [8, 8, 40, 46] : [10, 12, 42, 54];
      const { dimension } = engine.system;
      const aspect = dimension === 1 ? 0.3 : isPhone() ? 0.74 : 0.54;
      Object.assign(this, { engine, given, modes, dimension });
      this.plane = new Plane(element, { x: [0, 1], y: [0, 1], aspect, margin, redraw });
      const names = ["flow", "surface", "orbit", "marks"];
      this.layers = Object.fromEntries(names.map((name) => [name, svg("g")]));
      this.runner = svg("circle", { class: "runner", r: 6.5, visibility: "hidden" });
      this.plane.layer.append(...Object.values(this.layers), this.runner);
    }

    /** Draw all; surfaces and flow only when what they depend on has changed. */
    draw(state, view, pieces) {
      const { given } = this;
      this.view = view;
      this.plane.limits(...state.limits);
      this.drawOrbit(pieces);
      const shown = JSON.stringify([state.p, state.limits, state.flow, view.turn, this.plane.width]);
      if (shown !== this.shown) {
        this.shown = shown;
        for (const name of ["surface", "marks", "flow"]) this.layers[name].replaceChildren();
        [null, this.drawLine, this.drawPlane][this.dimension]?.call(this, state);
        if (this.dimension > 2) this.drawSpace(state);
        if (given.flow && state.flow !== "none") this.drawFlow(state);
        this.drawAxes();
      }
    }

    drawAxes() {
      const { plane, view } = this;
      const { states } = this.engine.system;
      if (view.flat) {
        plane.ticks(states[0], states[1] ?? "");
        if (!states[1]) plane.axes.querySelectorAll("text[text-anchor=end], path[d$=h5]").forEach((e) => e.remove());
        return;
      }
      const ends = [0, 1, 2].map((i) => {
        const middle = states.map((_, k) => (k > 2 ? 0 : view.middle(k)));
        return [-1, 1.1].map((s) => middle.map((v, k) => (k === i ? v + s * view.half(i) : v)));
      });
      const lines = ends.map((pair, i) => {
        const [tail, tip] = pair.map((x) => view.at(x));
        const name = plane.label(tip, states[i], { class: "axis-name halo" }, [0, -4]);
        const values = [text(view.pairs[i][1], 2), text(view.pairs[i][0], 2)].map((value, k) =>
          plane.label([tip, tail][k], value, { class: "halo soft" }, [0, 12]),
        );
        return [plane.path([tail, tip], { class: "zero" }), name, ...values];
      });
      plane.axes.replaceChildren(...lines.flat());
    }

    drawOrbit(pieces) {
      const { plane, view, modes } = this;
      const paths = pieces.map(({ x }) => drawn(plane, x.map((one) => view.at(one))));
      const parts = [svg("path", { d: paths.join(""), class: "casing" })];
      const jumps = pieces.filter(({ from }) => from).map(({ from, x }) => [from, x[0]]);
      const jump = jumps.map((pair) => drawn(plane, pair.map((one) => view.at(one)))).join("");
      if (jump) parts.push(svg("path", { d: jump, class: "jump" }));
      const lines = byClass([...pieces.keys()], (k) => modes.of(pieces[k].mode), (k) => paths[k]);
      for (const [name, d] of lines) parts.push(svg("path", { d, class: `orbit ${name}` }));
      if (pieces.length === 1 && pieces[0].x.length === 1) {
        const [x, y] = plane.at(view.at(pieces[0].x[0]));
        parts.push(svg("circle", { cx: x, cy: y, r: 5, class: `orbit ${modes.of(pieces[0].mode)}` }));
      }
      this.layers.orbit.replaceChildren(...parts);
    }

    /** Surfaces on a line of states. */
    drawLine(state) {
      const { plane, engine } = this;
      if (engine.system.n > 1) return;
      const [low, high] = state.limits[0];
      const at = Float64Array.from({ length: 401 }, (_, k) => low + ((high - low) * k) / 400);
      const rows = engine.sample(at, state.p, Array(engine.width).fill(1));
      for (let i = 0; i < engine.width; i++) {
        const h = (k) => rows[k * engine.row + 1 + engine.width + i];
        for (let k = 0; k < 400; k++) {
          if (h(k) > 0 === h(k + 1) > 0) continue;
          const zero = at[k] + ((at[k + 1] - at[k]) * h(k)) / (h(k) - h(k + 1));
          this.layers.surface.append(plane.path([[zero, -1], [zero, 1]], { class: "line" }));
        }
      }
    }

    /** Surfaces and special points of a plane. */
    drawPlane(state) {
      const { plane, engine, given } = this;
      const box = state.limits.flat();
      if (given.scan) {
        const { lines, marks } = Scan.planar(engine, state.p, box, given.slides);
        this.drawStretches(lines);
        this.layers.marks.append(...marks.flatMap((mark) => this.marked(mark)));
      } else if (engine.system.n === engine.system.dimension) {
        for (let i = 0; i < engine.width; i++) {
          const cut = new Scan.Plane(engine, state.p, box, (x) => x, i);
          const lines = Scan.zeroLines((points) => cut.heights(points), box, 40);
          this.layers.surface.append(svg("path", { d: lines.map((l) => drawn(plane, l)).join(""), class: "line" }));
        }
      }
    }

    drawStretches(lines) {
      const { plane } = this;
      for (const look of ["band", "line"]) {
        for (const [kind, d] of byClass(lines, ({ kind }) => kind, ({ line }) => drawn(plane, line))) {
          this.layers.surface.append(svg("path", { d, class: `${look} ${kind}` }));
        }
      }
    }

    /** Cuts of the first surface of a system in space by planes, with the kind of sliding. */
    drawSpace(state) {
      const { engine, view, plane } = this;
      if (!this.given.cuts || engine.system.n > engine.system.dimension) return;
      const rest = state.x;
      const [u, v, w] = this.given.cuts;
      const box = [...view.pairs[u], ...view.pairs[v]];
      const found = new Map();
      const folds = [];
      for (let k = 0; k < 9; k++) {
        const level = view.middle(w) + view.half(w) * (k / 4 - 1);
        const embed = (point) => rest.map((own, i) => (i === u ? point[0] : i === v ? point[1] : i === w ? level : own));
        const cut = Scan.surface(new Scan.Plane(engine, state.p, box, embed), 16);
        const seen = (one) => view.at(embed(one.x));
        for (const { kind, line } of cut.stretches) {
          found.set(kind, (found.get(kind) ?? "") + drawn(plane, line.map(seen)));
        }
        folds.push(...cut.folds.map((one) => [one.fold, seen(one)]));
      }
      for (const [kind, d] of found) this.layers.surface.append(svg("path", { d, class: `cut ${kind}` }));
      for (const [side, point] of folds) {
        const [x, y] = plane.at(point);
        this.layers.surface.append(svg("circle", { cx: x, cy: y, r: 2, class: side > 0 ? "fold above" : "fold below" }));
      }
    }

    /** A special point: its sign, and its name where there is room. */
    marked({ type, kind, x: point }) {
      const { plane } = this;
      const [x, y] = plane.at(point);
      const r = 5.5;
      const isSolid = /^(stable|visible)/.test(kind);
      const shapes = {
        fold: () => svg("path", { d: `M${x} ${y - r}l${r} ${r}l${-r} ${r}l${-r} ${-r}Z` }),
        pseudo: () => svg("rect", { x: x - r + 1, y: y - r + 1, width: 2 * r - 2, height: 2 * r - 2 }),
        equilibrium: () => svg("circle", { cx: x, cy: y, r: r - 0.5 }),
      };
      const shape = shapes[type]();
      shape.setAttribute("class", `mark ${isSolid ? "solid" : ""}`);
      shape.append(svg("title", {}, `${kind} at (${text(point[0], 6)}, ${text(point[1], 6)})`));
      if (plane.width < 480) return [shape];
      const right = x > plane.box.left + plane.box.width - 120;
      const low = y < plane.box.top + 20;
      const place = { x: x + (right ? -10 : 10), y: low ? y + 17 : y - 8, "text-anchor": right ? "end" : "start" };
      return [shape, svg("text", { ...place, class: "mark-name" }, kind)];
    }

    /** Short orbits from starts all over the plane. */
    drawFlow(state) {
      const { plane, engine, modes, view } = this;
      const [[a, b], [c, d]] = state.limits;
      const [columns, rows] = isPhone() ? [7, 5] : [11, 7];
      const longest = state.flow === "short" ? 0.08 : 0.6;
      const seen = ([u, v]) => [(u - a) / (b - a), (v - c) / (d - c)];
      const paths = new Map();
      for (let j = 0; j < rows; j++) {
        for (let i = 0; i < columns; i++) {
          const x = [a + ((i + (j % 2 ? 0.75 : 0.25)) / columns) * (b - a), c + ((j + 0.5) / rows) * (d - c)];
          const options = { tEnd: this.timeOf(x, state, longest), tol: 1e-6, steps: 60, events: 12 };
          const run = engine.simulate(x, state.p, options);
          const pieces = Orbit.pieces(run, engine.system, { seen, dense: 120, longest });
          for (const [name, d] of byClass(pieces, (own) => modes.of(own.mode), (own) => drawn(plane, own.x))) {
            paths.set(name, (paths.get(name) ?? "") + d);
          }
          const { x: points, mode } = pieces.at(-1);
          const head = { class: `head-of-flow ${modes.of(mode)}` };
          if (points.length > 2) this.layers.flow.append(plane.arrow(points.map((one) => view.at(one)), 1, head, 3.6));
        }
      }
      for (const [name, d] of paths) this.layers.flow.prepend(svg("path", { d, class: `flow ${name}` }));
    }

    /** Time in which an orbit may come as far as it is drawn. */
    timeOf(x, state, longest) {
      const { engine } = this;
      const [[a, b], [c, d]] = state.limits;
      const point = Float64Array.from(engine.system.n > 2 ? [...x, 0] : x);
      const speeds = [1, -1].map((sign) => {
        const rates = engine.sample(point, state.p, Array(engine.width).fill(sign));
        return Math.hypot(rates[0] / (b - a), rates[1] / (d - c));
      });
      return Math.min(state.t, (3 * longest) / Math.max(...speeds.filter(Number.isFinite), 1e-9));
    }
  }

  /** States over the time, each in a strip of its own. */
  class Series {
    static MOST = 4;

    /** `sizes` are those of the states. */
    constructor(element, system, sizes, modes, redraw) {
      const margin = isPhone() ? [6, 8, 40, 46] : [6, 12, 42, 54];
      Object.assign(this, { system, sizes, modes });
      this.plane = new Plane(element, { x: [0, 1], y: [0, 1], aspect: isPhone() ? 0.5 : 0.33, margin, redraw });
      this.cursor = svg("path", { class: "cursor", visibility: "hidden" });
      this.plane.over.append(this.cursor);
    }

    draw(pieces, end) {
      const { plane } = this;
      const { states, dimension } = this.system;
      const rows = Math.min(dimension, Series.MOST);
      plane.limits([0, end], [0, 1]);
      const slid = pieces.filter(({ mode }) => /^[^,]*[s*]/.test(mode));
      const parts = slid.map(({ t }) =>
        plane.polygon([[t[0], 0], [t.at(-1), 0], [t.at(-1), 1], [t[0], 1]], { class: "slid" }),
      );
      const labels = [];
      for (let i = 0; i < rows; i++) {
        const { paths, low, high, top, bottom } = this.strip(pieces, i, rows, end);
        for (const [name, d] of paths) parts.push(svg("path", { d, class: `orbit thin ${name}` }));
        if (i) parts.push(plane.path([[0, 1 - i / rows], [end, 1 - i / rows]], { class: "zero" }));
        const [left, upper] = plane.at([0, top]);
        const [, lower] = plane.at([0, bottom]);
        const side = { "text-anchor": "end" };
        const digits = isPhone() ? 2 : 3;
        labels.push(svg("text", { x: left - 7, y: upper + 9, ...side }, text(high, digits)));
        labels.push(svg("text", { x: left - 7, y: lower + 1, ...side }, text(low, digits)));
        const name = { x: left - 8, y: (upper + lower) / 2 + 5, ...side, class: "axis-name" };
        labels.push(svg("text", name, states[i]));
      }
      plane.layer.replaceChildren(...parts);
      plane.ticks("time", "");
      plane.axes.querySelectorAll("text[text-anchor=end], path[d$=h5]").forEach((e) => e.remove());
      plane.axes.append(...labels);
    }

    strip(pieces, i, rows, end) {
      const { plane, modes } = this;
      let [low, high] = [Infinity, -Infinity];
      for (const { x } of pieces) {
        for (const one of x) [low, high] = [Math.min(low, one[i]), Math.max(high, one[i])];
      }
      const size = this.sizes[i];
      if (!(high - low > 1e-9 * size)) [low, high] = [low - size / 2, high + size / 2]; // constant, to rounding
      if (Math.abs(low) < 1e-9 * (high - low)) low = 0;
      if (Math.abs(high) < 1e-9 * (high - low)) high = 0;
      const top = 1 - (i + 0.06) / rows;
      const bottom = 1 - (i + 0.94) / rows;
      const pixel = end / plane.box.width;
      const curve = ({ t, x }) => {
        const points = [];
        for (let k = 0, last = -Infinity; k < t.length; k++) {
          if (t[k] - last <= pixel && k < t.length - 1) continue;
          points.push([t[k], bottom + ((x[k][i] - low) / (high - low)) * (top - bottom)]);
          last = t[k];
        }
        return drawn(plane, points);
      };
      return { paths: byClass(pieces, ({ mode }) => modes.of(mode), curve), low, high, top, bottom };
    }
  }

  /** Points of a sweep on a canvas behind a frame with axes. */
  class Cloud {
    constructor(element, canvas, redraw) {
      const margin = isPhone() ? [8, 8, 40, 46] : [8, 12, 42, 54];
      Object.assign(this, { canvas, lists: [] });
      this.plane = new Plane(element, { x: [0, 1], y: [0, 1], aspect: isPhone() ? 0.62 : 0.46, margin, redraw });
    }

    /** `usual` is the range of the state in the portrait; the cloud reaches ten times as far at most. */
    begin(range, names, usual) {
      Object.assign(this, { range, names, usual, lists: [] });
      this.draw();
    }

    add(points) {
      this.lists.push(points);
      if (Math.log2(this.lists.length) % 1 === 0) this.draw(); // limits that fit, ever less often
      else this.paint(points);
    }

    /** Limits of nearly all states: few that leave do not flatten the others. */
    limits() {
      const all = Float64Array.from(this.lists.flatMap((list) => list.filter((_, k) => k % 2))).sort();
      const [a, b] = this.usual;
      if (!all.length) return this.usual;
      const least = Math.max(all[Math.floor(0.02 * all.length)], a - 10 * (b - a));
      const most = Math.min(all[Math.ceil(0.98 * all.length) - 1], b + 10 * (b - a));
      const [low, high] = least <= most ? [least, most] : this.usual;
      const gap = Math.max(0.08 * (high - low), 0.02 * (b - a));
      return [low - gap, high + gap];
    }

    draw() {
      const { plane, canvas } = this;
      if (!this.range) return;
      const ratio = devicePixelRatio || 1;
      plane.limits(this.range, this.limits());
      Object.assign(canvas, { width: plane.width * ratio, height: plane.height * ratio });
      Object.assign(canvas.style, { width: `${plane.width}px`, height: `${plane.height}px` });
      const pen = canvas.getContext("2d");
      const { left, top, width, height } = plane.box;
      pen.scale(ratio, ratio);
      pen.beginPath();
      pen.rect(left, top, width, height);
      pen.clip();
      this.lists.forEach((list) => this.paint(list));
      plane.ticks(...this.names);
      this.mark();
    }

    paint(list) {
      const pen = this.canvas.getContext("2d");
      pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--ink");
      pen.globalAlpha = 0.5;
      for (let k = 0; k < list.length; k += 2) {
        const [x, y] = this.plane.at([list[k], list[k + 1]]);
        pen.fillRect(x - 0.6, y - 0.6, 1.2, 1.2);
      }
    }

    /** A line at the present value of the parameter. */
    mark(value = this.value) {
      const { plane } = this;
      this.value = value;
      if (value === undefined) return;
      const line = [[value, plane.y[0]], [value, plane.y[1]]];
      plane.layer.replaceChildren(plane.path(line, { class: "present" }));
    }
  }

  /** The key of modes that are seen, and of sliding. */
  function key(list, names) {
    const swatch = (look) => svg("svg", { viewBox: "0 0 34 14" }, svg("path", { d: "M2 7H32", class: look }));
    list.replaceChildren(...names.map(([look, words]) => html("li", {}, swatch(look), words)));
  }

  return { Modes, Portrait, Series, Cloud, key, isPhone };
})();
