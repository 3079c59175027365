// Colours of modes, time series, and the cloud of a sweep.
"use strict";

const Pictures = (() => {
  const { svg, html, text, Plane } = Page;
  const isPhone = () => innerWidth < 900;

  /** Letters of a mode, without the values of discrete states. */
  function lettersOf(mode) {
    const [first] = mode.split(",");
    return first.includes("=") ? "" : first;
  }

  /** A class of lines for each mode: off surfaces and sets, below, sliding or in contact, and three for others. */
  class Modes {
    others = [];

    of(mode) {
      const letters = lettersOf(mode);
      if (/[sc]/.test(letters)) return "mode-slide";
      if (mode !== letters) return this.further(mode);
      if (/^[+o*]*$/.test(letters)) return "mode-above";
      if (/^-+$/.test(letters)) return "mode-below";
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

  /** States over the time, each in a strip of its own. */
  class Series {
    static MOST = 4;

    /** `sizes` are those of the states. */
    constructor(element, system, sizes, modes, redraw) {
      const margin = isPhone() ? [6, 8, 40, 52] : [6, 12, 42, 62];
      Object.assign(this, { system, sizes, modes });
      this.plane = new Plane(element, {
        x: [0, 1],
        y: [0, 1],
        aspect: isPhone() ? 0.5 : 0.33,
        margin,
        redraw,
      });
      this.cursor = svg("path", { class: "cursor", visibility: "hidden" });
      this.plane.over.append(this.cursor);
    }

    draw(pieces, end) {
      const { plane } = this;
      const { states, dimension } = this.system;
      const rows = Math.min(dimension, Series.MOST);
      plane.limits([0, end], [0, 1]);
      const slid = pieces.filter(({ mode }) => lettersOf(mode).includes("s"));
      const parts = slid.map(({ t }) =>
        plane.polygon(
          [
            [t[0], 0],
            [t.at(-1), 0],
            [t.at(-1), 1],
            [t[0], 1],
          ],
          { class: "slid" },
        ),
      );
      const labels = [];
      for (let i = 0; i < rows; i++) {
        const { paths, low, high, top, bottom } = this.strip(pieces, i, rows, end);
        for (const [name, d] of paths) parts.push(svg("path", { d, class: `orbit thin ${name}` }));
        if (i)
          parts.push(
            plane.path(
              [
                [0, 1 - i / rows],
                [end, 1 - i / rows],
              ],
              { class: "zero" },
            ),
          );
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
      return {
        paths: byClass(pieces, ({ mode }) => modes.of(mode), curve),
        low,
        high,
        top,
        bottom,
      };
    }
  }

  /** Points of a sweep on a canvas behind a frame with axes. */
  class Cloud {
    constructor(element, canvas, redraw) {
      const margin = isPhone() ? [8, 8, 40, 52] : [8, 12, 42, 62];
      Object.assign(this, { canvas, lists: [] });
      this.plane = new Plane(element, {
        x: [0, 1],
        y: [0, 1],
        aspect: isPhone() ? 0.62 : 0.46,
        margin,
        redraw,
      });
    }

    /** `usual` is the range of the state in the portrait; the cloud reaches ten times as far at most. */
    begin(range, names, usual) {
      Object.assign(this, { range, names, usual, lists: [] });
      this.draw();
    }

    add(points) {
      this.lists.push(points);
      if (Math.log2(this.lists.length) % 1 === 0)
        this.draw(); // limits that fit, ever less often
      else this.paint(points);
    }

    /** Limits of nearly all states: few that leave do not flatten the others. */
    limits() {
      const all = Float64Array.from(
        this.lists.flatMap((list) => list.filter((_, k) => k % 2)),
      ).sort();
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
      const line = [
        [value, plane.y[0]],
        [value, plane.y[1]],
      ];
      plane.layer.replaceChildren(plane.path(line, { class: "present" }));
    }
  }

  /** The key of modes that are seen, and of sliding. */
  function key(list, names) {
    const swatch = (look) =>
      svg("svg", { viewBox: "0 0 34 14" }, svg("path", { d: "M2 7H32", class: look }));
    list.replaceChildren(...names.map(([look, words]) => html("li", {}, swatch(look), words)));
  }

  return { Modes, Series, Cloud, key, isPhone, drawn, byClass };
})();
