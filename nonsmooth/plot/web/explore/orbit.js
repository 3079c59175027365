// An orbit as lines of one mode each, and how a space of states is seen in a plane.
"use strict";

const Orbit = (() => {
  /**
   * Pieces of a run {mode, t, x}, new ones at each change of the mode and each jump, where `from` is the state
   * before. `seen` takes states to the plane of the picture, whose unit is its width; a unit has `dense` points.
   */
  function pieces(run, system, { seen, dense, longest = Infinity }) {
    const found = [];
    const far = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]);
    let piece = null;
    let length = 0;
    for (let k = 0; k < run.steps && length < longest; k++) {
      const start = run.starts[k];
      const h = (k + 1 < run.steps ? run.starts[k + 1] : run.t) - start;
      const at = (s) => Engine.onStep(run, system, k, s).x;
      const first = at(0);
      const before = piece?.x.at(-1);
      const joins = before?.every((v, i) => Math.abs(v - first[i]) <= 1e-6 * (1 + Math.abs(v)));
      if (!joins || piece.mode !== run.stepModes[k]) {
        piece = {
          mode: run.stepModes[k],
          t: [start],
          x: [first],
          from: before && !joins ? before : null,
        };
        found.push(piece);
      }
      const [a, b, c] = [0, h / 2, h].map((s) => seen(at(s)));
      const size = far(a, b) + far(b, c);
      const count = Math.min(Math.max(Math.ceil(dense * size), 3), 48);
      for (let q = 1; q <= count && length < longest; q++) {
        piece.t.push(start + (h * q) / count);
        piece.x.push(at((h * q) / count));
        length += size / count;
      }
    }
    if (!found.length) found.push({ mode: run.itinerary, t: [run.t], x: [[...run.x]], from: null });
    return found;
  }

  /** Period of the last events, if they repeat to six digits; 0 if not. */
  function period(run, n, dimension) {
    const { events, eventT, eventX, eventKind } = run;
    const last = events - 1;
    const scale = Array.from({ length: dimension }, (_, i) => {
      let most = 1e-9;
      for (let k = Math.max(0, events - 50); k < events; k++)
        most = Math.max(most, Math.abs(eventX[k * n + i]));
      return most;
    });
    const same = (k, lag) =>
      eventKind[k] === eventKind[k - lag] &&
      scale.every((s, i) => Math.abs(eventX[k * n + i] - eventX[(k - lag) * n + i]) < 1e-6 * s);
    for (let lag = 1; lag < Math.min(events / 2, 60); lag++) {
      let all = true;
      for (let q = 0; q <= lag && all; q++) all = same(last - q, lag);
      if (all) return eventT[last] - eventT[last - lag];
    }
    return 0;
  }

  /** How states are seen: a planar system as it is; three states turned by angles; `unit` is the picture's width. */
  class View {
    constructor(box, dimension) {
      this.pairs = Array.from({ length: dimension }, (_, i) => box.slice(2 * i, 2 * i + 2));
      this.dimension = dimension;
      this.turn = [0.6, 0.35];
    }

    get flat() {
      return this.dimension < 3;
    }

    /** Ranges of the axes of the picture. */
    get limits() {
      if (this.dimension === 2) return this.pairs;
      return this.flat
        ? [this.pairs[0], [-1, 1]]
        : [
            [-1.75, 1.75],
            [-1.2, 1.2],
          ];
    }

    middle(i) {
      return (this.pairs[i][0] + this.pairs[i][1]) / 2;
    }

    half(i) {
      return (this.pairs[i][1] - this.pairs[i][0]) / 2;
    }

    /** Directions of the picture's axes in units of the box. */
    get axes() {
      const [yaw, pitch] = this.turn;
      const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
      return [
        [cy, sy, 0],
        [-sy * sp, cy * sp, cp],
      ];
    }

    /** Point of the picture of a state. */
    at(x) {
      if (this.dimension === 2) return x;
      if (this.flat) return [x[0], 0];
      const y = [0, 1, 2].map((i) => (x[i] - this.middle(i)) / this.half(i));
      return this.axes.map((axis) => axis[0] * y[0] + axis[1] * y[1] + axis[2] * y[2]);
    }

    /** State whose point is another one: moved in the plane of the picture. */
    moved(x, point) {
      if (this.dimension === 2) return point;
      if (this.flat) return [point[0]];
      const now = this.at(x);
      const [right, up] = this.axes;
      return x.map((v, i) =>
        i > 2
          ? v
          : v + this.half(i) * ((point[0] - now[0]) * right[i] + (point[1] - now[1]) * up[i]),
      );
    }
  }

  return { pieces, period, View };
})();

if (typeof module !== "undefined") module.exports = { Orbit };
