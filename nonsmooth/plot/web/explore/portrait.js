// The portrait of a system: its plane with surfaces, special points and flow, or its orbit in space.
"use strict";

/** The plane of a system with one or two states, and the projection of one with more. */
class Portrait {
  constructor(element, engine, given, modes, redraw) {
    const margin = Pictures.isPhone() ? [8, 8, 40, 52] : [10, 12, 42, 62];
    const { dimension } = engine.system;
    const aspect = dimension === 1 ? 0.3 : Pictures.isPhone() ? 0.74 : 0.54;
    Object.assign(this, { engine, given, modes, dimension });
    this.plane = new Page.Plane(element, { x: [0, 1], y: [0, 1], aspect, margin, redraw });
    const names = ["flow", "surface", "orbit", "marks"];
    this.layers = Object.fromEntries(names.map((name) => [name, Page.svg("g")]));
    this.runner = Page.svg("circle", { class: "runner", r: 6.5, visibility: "hidden" });
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
      if (!states[1])
        plane.axes
          .querySelectorAll("text[text-anchor=end], path[d$=h5]")
          .forEach((e) => e.remove());
      return;
    }
    const ends = [0, 1, 2].map((i) => {
      const middle = states.map((_, k) => (k > 2 ? 0 : view.middle(k)));
      return [-1, 1.1].map((s) => middle.map((v, k) => (k === i ? v + s * view.half(i) : v)));
    });
    const lines = ends.map((pair, i) => {
      const [tail, tip] = pair.map((x) => view.at(x));
      const name = plane.label(tip, states[i], { class: "axis-name halo" }, [0, -4]);
      const values = [Page.text(view.pairs[i][1], 2), Page.text(view.pairs[i][0], 2)].map(
        (value, k) => plane.label([tip, tail][k], value, { class: "halo soft" }, [0, 12]),
      );
      return [plane.path([tail, tip], { class: "zero" }), name, ...values];
    });
    plane.axes.replaceChildren(...lines.flat());
  }

  drawOrbit(pieces) {
    const { plane, view, modes } = this;
    const paths = pieces.map(({ x }) =>
      Pictures.drawn(
        plane,
        x.map((one) => view.at(one)),
      ),
    );
    const parts = [Page.svg("path", { d: paths.join(""), class: "casing" })];
    const jumps = pieces.filter(({ from }) => from).map(({ from, x }) => [from, x[0]]);
    const jump = jumps
      .map((pair) =>
        Pictures.drawn(
          plane,
          pair.map((one) => view.at(one)),
        ),
      )
      .join("");
    if (jump) parts.push(Page.svg("path", { d: jump, class: "jump" }));
    const lines = Pictures.byClass(
      [...pieces.keys()],
      (k) => modes.of(pieces[k].mode),
      (k) => paths[k],
    );
    for (const [name, d] of lines) parts.push(Page.svg("path", { d, class: `orbit ${name}` }));
    if (pieces.length === 1 && pieces[0].x.length === 1) {
      const [x, y] = plane.at(view.at(pieces[0].x[0]));
      parts.push(
        Page.svg("circle", { cx: x, cy: y, r: 5, class: `orbit ${modes.of(pieces[0].mode)}` }),
      );
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
        this.layers.surface.append(
          plane.path(
            [
              [zero, -1],
              [zero, 1],
            ],
            { class: "line" },
          ),
        );
      }
    }
  }

  /** Surfaces and special points of a plane. */
  drawPlane(state) {
    const { plane, engine, given } = this;
    const box = state.limits.flat();
    if (given.scan) {
      const { lines, marks } = Scan.planar(engine, state.p, box, given.slides);
      this.names = [];
      this.drawStretches(lines);
      this.layers.marks.append(...marks.flatMap((mark) => this.marked(mark)));
    } else if (engine.system.n === engine.system.dimension) {
      for (let i = 0; i < engine.width; i++) {
        if (engine.system.tables.some(({ element }) => element === i)) continue; // its function follows the cell
        const cut = new Scan.Plane(engine, state.p, box, (x) => x, i);
        const lines = Scan.zeroLines((points) => cut.heights(points), box, 40);
        this.layers.surface.append(
          Page.svg("path", {
            d: lines.map((l) => Pictures.drawn(plane, l)).join(""),
            class: "line",
          }),
        );
      }
    }
  }

  drawStretches(lines) {
    const { plane } = this;
    for (const look of ["band", "line"]) {
      for (const [kind, d] of Pictures.byClass(
        lines,
        ({ kind }) => kind,
        ({ line }) => Pictures.drawn(plane, line),
      )) {
        this.layers.surface.append(Page.svg("path", { d, class: `${look} ${kind}` }));
      }
    }
  }

  /** The surface of a system in space as its cuts by planes: stretches and folds, which are kept while it is turned. */
  cutsOf(state) {
    const { engine, view, given } = this;
    const rest = engine.system.states.length > 3 ? state.x : [0, 0, 0];
    const key = JSON.stringify([state.p, rest.slice(3), view.pairs]);
    if (key === this.cut?.key) return this.cut;
    const found = { key, lines: [], folds: [] };
    given.cuts.forEach(([u, v, w], family) => {
      const box = [...view.pairs[u], ...view.pairs[v]];
      for (let k = 0; k < 9; k++) {
        const level = view.middle(w) + view.half(w) * (k / 4 - 1);
        const at = (point) =>
          rest.map((own, i) => ({ [u]: point[0], [v]: point[1], [w]: level })[i] ?? own);
        const { stretches, folds } = Scan.surface(new Scan.Plane(engine, state.p, box, at), 16);
        const drawn = family ? [] : stretches;
        found.lines.push(
          ...drawn.map(({ kind, line }) => ({ kind, line: line.map((one) => at(one.x)) })),
        );
        const special = given.slides ? folds : [];
        found.folds.push(...special.map((one) => ({ side: one.fold, x: at(one.x) })));
      }
    });
    this.cut = found;
    return found;
  }

  drawSpace(state) {
    const { engine, view, plane } = this;
    if (!this.given.cuts || engine.system.n > engine.system.dimension) return;
    const { lines, folds } = this.cutsOf(state);
    const path = ({ line }) =>
      Pictures.drawn(
        plane,
        line.map((x) => view.at(x)),
      );
    for (const [kind, d] of Pictures.byClass(lines, ({ kind }) => kind, path)) {
      this.layers.surface.append(Page.svg("path", { d, class: `cut ${kind}` }));
    }
    for (const { side, x } of folds) {
      const [cx, cy] = plane.at(view.at(x));
      const look = `fold ${side > 0 ? "above" : "below"}`;
      this.layers.surface.append(Page.svg("circle", { cx, cy, r: 2, class: look }));
    }
  }

  /** A special point: its sign, and its name where there is room. */
  marked({ type, kind, x: point }) {
    const { plane } = this;
    const [x, y] = plane.at(point);
    const r = 5.5;
    const isSolid = /^(stable|visible)/.test(kind);
    const shapes = {
      fold: () => Page.svg("path", { d: `M${x} ${y - r}l${r} ${r}l${-r} ${r}l${-r} ${-r}Z` }),
      pseudo: () =>
        Page.svg("rect", { x: x - r + 1, y: y - r + 1, width: 2 * r - 2, height: 2 * r - 2 }),
      equilibrium: () => Page.svg("circle", { cx: x, cy: y, r: r - 0.5 }),
    };
    const shape = shapes[type]();
    shape.setAttribute("class", `mark ${isSolid ? "solid" : ""}`);
    shape.append(
      Page.svg("title", {}, `${kind} at (${Page.text(point[0], 6)}, ${Page.text(point[1], 6)})`),
    );
    return [shape, ...(plane.width < 480 ? [] : this.named(x, y, kind))];
  }

  /** A name beside a point, where no other name is; none where there is no room. */
  named(x, y, words) {
    const { left, top, width, height } = this.plane.box;
    const size = { width: 6.4 * words.length, height: 14 };
    const sides = [
      [10, -8],
      [10, 17],
      [-10, -8],
      [-10, 17],
    ];
    const boxes = sides.map(([dx, dy]) => ({
      ...{ x: dx > 0 ? x + dx : x + dx - size.width, y: y + dy - 11, ...size },
      ...{ at: { x: x + dx, y: y + dy, "text-anchor": dx > 0 ? "start" : "end" } },
    }));
    const meets = (one, other) =>
      Math.abs(one.x - other.x + (one.width - other.width) / 2) < (one.width + other.width) / 2 &&
      Math.abs(one.y - other.y) < 14;
    const fits = (one) =>
      one.x > left && one.x + one.width < left + width && one.y > top && one.y + 14 < top + height;
    const free = boxes.find((one) => fits(one) && !this.names.some((other) => meets(one, other)));
    if (!free) return [];
    this.names.push(free);
    return [Page.svg("text", { ...free.at, class: "mark-name" }, words)];
  }

  /** Short orbits from starts all over the plane. */
  drawFlow(state) {
    const { plane, engine, modes, view } = this;
    const [[a, b], [c, d]] = state.limits;
    const [columns, rows] = Pictures.isPhone() ? [7, 5] : [11, 7];
    const longest = state.flow === "short" ? 0.08 : 0.6;
    const seen = ([u, v]) => [(u - a) / (b - a), (v - c) / (d - c)];
    const paths = new Map();
    for (let j = 0; j < rows; j++) {
      for (let i = 0; i < columns; i++) {
        const x = [
          a + ((i + (j % 2 ? 0.75 : 0.25)) / columns) * (b - a),
          c + ((j + 0.5) / rows) * (d - c),
        ];
        const options = {
          tEnd: this.timeOf(x, state, longest),
          tol: 1e-6,
          steps: 60,
          events: 12,
        };
        const run = engine.simulate(x, state.p, options);
        const pieces = Orbit.pieces(run, engine.system, { seen, dense: 120, longest });
        for (const [name, d] of Pictures.byClass(
          pieces,
          (own) => modes.of(own.mode),
          (own) => Pictures.drawn(plane, own.x),
        )) {
          paths.set(name, (paths.get(name) ?? "") + d);
        }
        const { x: points, mode } = pieces.at(-1);
        const head = { class: `head-of-flow ${modes.of(mode)}` };
        if (points.length > 2)
          this.layers.flow.append(
            plane.arrow(
              points.map((one) => view.at(one)),
              1,
              head,
              3.6,
            ),
          );
      }
    }
    for (const [name, d] of paths)
      this.layers.flow.prepend(Page.svg("path", { d, class: `flow ${name}` }));
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
