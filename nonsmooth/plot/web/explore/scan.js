// What is special in a plane of a system: where surfaces cut it, sliding segments, folds, equilibria.
"use strict";

const Scan = (() => {
  /** Values on the corners of cells; corner (i, j) is number j * (cells + 1) + i. */
  function grid([a, b, c, d], cells) {
    const n = cells + 1;
    const points = [];
    for (let j = 0; j < n; j++) {
      for (let i = 0; i < n; i++)
        points.push([a + ((b - a) * i) / cells, c + ((d - c) * j) / cells]);
    }
    return points;
  }

  /** Edges of cells on which h changes its sign, and the pairs of edges that share a cell. */
  function cutEdges(h, cells) {
    const n = cells + 1;
    const numbers = new Map();
    const edges = [];
    const links = [];
    const numberOf = (k, l) => {
      const key = k * n * n + l;
      if (!numbers.has(key)) numbers.set(key, edges.push([k, l]) - 1);
      return numbers.get(key);
    };
    for (let j = 0; j < cells; j++) {
      for (let i = 0; i < cells; i++) {
        const k = j * n + i;
        const sides = [
          [k, k + 1],
          [k + 1, k + 1 + n],
          [k + n, k + n + 1],
          [k, k + n],
        ];
        const cut = sides.filter(([u, v]) => h[u] > 0 !== h[v] > 0).map(([u, v]) => numberOf(u, v));
        for (let q = 0; q + 1 < cut.length; q += 2) links.push([cut[q], cut[q + 1]]);
      }
    }
    return { edges, links };
  }

  /** An interval in which a function changes its sign, narrowed by the Illinois method. */
  class Bracket {
    constructor(atLow, atHigh) {
      Object.assign(this, { low: 0, high: 1, atLow, atHigh, kept: 0 });
    }

    /** Where to evaluate next. */
    get share() {
      const { low, high, atLow, atHigh } = this;
      return atLow === atHigh ? (low + high) / 2 : (low * atHigh - high * atLow) / (atHigh - atLow);
    }

    /** Take a value; an end that stays twice counts half. */
    narrow(share, value) {
      if (value > 0 === this.atLow > 0) {
        Object.assign(this, {
          low: share,
          atLow: value,
          atHigh: this.kept > 0 ? 0.5 * this.atHigh : this.atHigh,
        });
        this.kept = 1;
      } else {
        Object.assign(this, {
          high: share,
          atHigh: value,
          atLow: this.kept < 0 ? 0.5 * this.atLow : this.atLow,
        });
        this.kept = -1;
      }
    }
  }

  /** Zeros of h on edges, all at once. */
  function zerosOn(edges, points, h, height) {
    const brackets = edges.map(([k, l]) => new Bracket(h[k], h[l]));
    let found = [];
    for (let round = 0; round < 8 && edges.length; round++) {
      const shares = brackets.map((own) => own.share);
      found = edges.map(([k, l], q) => points[k].map((v, e) => v + shares[q] * (points[l][e] - v)));
      height(found).forEach((value, q) => brackets[q].narrow(shares[q], value));
    }
    return found;
  }

  /** Join linked points to chains; those that begin at an end come before closed ones. */
  function chained(count, links) {
    const next = Array.from({ length: count }, () => []);
    links.forEach(([u, v], k) => {
      next[u].push([v, k]);
      next[v].push([u, k]);
    });
    const used = new Set();
    const chains = [];
    const order = [...next.keys()].sort((u, v) => next[u].length - next[v].length);
    for (const first of order) {
      for (const [, link] of next[first]) {
        if (used.has(link)) continue;
        const chain = [first];
        for (let at = first; ;) {
          const go = next[at].find(([, k]) => !used.has(k));
          if (!go) break;
          used.add(go[1]);
          at = go[0];
          chain.push(at);
        }
        chains.push(chain);
      }
    }
    return chains;
  }

  /** Lines on which a function of a plane is zero: lists of points. */
  function zeroLines(height, box, cells) {
    const points = grid(box, cells);
    const h = height(points);
    const { edges, links } = cutEdges(h, cells);
    const zeros = zerosOn(edges, points, h, height);
    return chained(zeros.length, links).map((chain) => chain.map((k) => zeros[k]));
  }

  /**
   * Functions of a plane in the space of states: `embed` takes a point of the plane to a state. `at` gives the
   * fields of both sides of surface i, and their rates of h there.
   */
  class Plane {
    constructor(engine, p, box, embed, surface = 0) {
      Object.assign(this, { engine, p, box, embed, surface });
      this.row = engine.row;
      this.cell = [(box[1] - box[0]) / 40, (box[3] - box[2]) / 40];
    }

    sampled(points, sign) {
      const { n } = this.engine.system;
      const states = new Float64Array(points.length * n);
      points.forEach((point, k) => states.set(this.embed(point), k * n));
      return this.engine.sample(states, this.p, Array(this.engine.width).fill(sign));
    }

    /** Values of the surface (or gap) at points. */
    heights(points) {
      const { row, surface } = this;
      const values = this.sampled(points, 1);
      const at = this.engine.system.n + this.engine.width + surface;
      return points.map((_, k) => values[k * row + at]);
    }

    at(points) {
      const { row } = this;
      const { n } = this.engine.system;
      const [one, two] = [1, -1].map((sign) => this.sampled(points, sign));
      return points.map((x, k) => {
        const [f1, f2] = [one, two].map((values) =>
          Array.from(values.subarray(k * row, k * row + n)),
        );
        const [l1, l2] = [one, two].map((values) => values[k * row + n + this.surface]);
        return { x, f1, f2, l1, l2 };
      });
    }

    /** Move points onto h = 0 by Newton's method with differences. */
    onto(points) {
      let moved = points;
      const e = 1e-6 * (this.cell[0] + this.cell[1]);
      for (let round = 0; round < 2; round++) {
        const around = moved.flatMap(([u, v]) => [
          [u, v],
          [u + e, v],
          [u, v + e],
        ]);
        const h = this.heights(around);
        moved = moved.map(([u, v], k) => {
          const [value, right, up] = h.slice(3 * k, 3 * k + 3);
          const slope = [(right - value) / e, (up - value) / e];
          const size = slope[0] ** 2 + slope[1] ** 2;
          return size > 0 ? [u - (value * slope[0]) / size, v - (value * slope[1]) / size] : [u, v];
        });
      }
      return moved;
    }

    /** Zero of a function on the surface between two of its points, which differ in its sign. */
    root(from, to, value) {
      const bracket = new Bracket(value(from), value(to));
      let found = from;
      for (let round = 0; round < 40 && bracket.high - bracket.low > 1e-13; round++) {
        const { share } = bracket;
        [found] = this.at(this.onto([from.x.map((v, e) => v + share * (to.x[e] - v))]));
        const here = value(found);
        if (Math.abs(here) < 1e-14 || !Number.isFinite(here)) break;
        bracket.narrow(share, here);
      }
      return found;
    }

    apart(p, q) {
      return Math.hypot((p.x[0] - q.x[0]) / this.cell[0], (p.x[1] - q.x[1]) / this.cell[1]);
    }
  }

  const kindOf = ({ l1, l2 }) =>
    l1 < 0 && l2 > 0 ? "attracting" : l1 > 0 && l2 < 0 ? "repelling" : "crossing";

  /** Points of a line with its folds between them; `fold` is the side that is tangent. */
  function withFolds(plane, points) {
    const line = [points[0]];
    for (let k = 1; k < points.length; k++) {
      const [p, q] = [points[k - 1], points[k]];
      let cuts = [
        ["l1", 1],
        ["l2", -1],
      ]
        .filter(([name]) => p[name] > 0 !== q[name] > 0)
        .map(([name, fold]) => ({ ...plane.root(p, q, (one) => one[name]), fold }));
      // two folds of one side at one point: a double root that rounding divides
      const twin = (one) => (other) => other.fold === one.fold && plane.apart(one, other) < 1e-3;
      for (const one of line.filter((o) => o.fold && cuts.some(twin(o)))) {
        line.splice(line.indexOf(one), 1);
        cuts = cuts.filter((other) => !twin(one)(other));
      }
      line.push(...cuts.sort((u, v) => plane.apart(u, p) - plane.apart(v, p)), q);
    }
    return line;
  }

  /** Stretches of a line between folds: attracting or repelling sliding, or crossing. */
  function stretches(plane, line) {
    const found = [];
    for (let k = 0; k + 1 < line.length; k++) {
      const [u, v] = [line[k], line[k + 1]];
      const middle = () => plane.at(plane.onto([u.x.map((one, e) => (one + v.x[e]) / 2)]))[0];
      const kind = kindOf(!u.fold ? u : !v.fold ? v : middle());
      if (found.at(-1)?.kind !== kind) found.push({ kind, line: [u] });
      found.at(-1).line.push(v);
    }
    return found;
  }

  /** The sliding field of Filippov's convention; at a fold, that of the side that is tangent. */
  function slidingField({ f1, f2, l1, l2, fold }) {
    if (fold) return fold === 1 ? f1 : f2;
    return f1.map((_, e) => (l2 * f1[e] - l1 * f2[e]) / (l2 - l1));
  }

  /** Zeros of the sliding field on a stretch. */
  function pseudoEquilibria(plane, { kind, line }) {
    const found = [];
    for (let k = 0; k + 1 < line.length; k++) {
      const [u, v] = [line[k], line[k + 1]];
      const along = [v.x[0] - u.x[0], v.x[1] - u.x[1]];
      const speed = (one) => {
        const field = slidingField(one);
        return field[0] * along[0] + field[1] * along[1];
      };
      if (speed(u) > 0 === speed(v) > 0) continue;
      const { x } = plane.root(u, v, speed);
      const stays = speed(u) > 0 === (kind === "attracting");
      const name = !stays
        ? "pseudo-saddle"
        : `${kind === "attracting" ? "stable" : "unstable"} pseudo-node`;
      found.push({ type: "pseudo", x, kind: name });
    }
    return found;
  }

  /** A fold as a mark: visible where the tangent orbit stays on its own side. */
  function foldMark(plane, one) {
    const field = one.fold === 1 ? one.f1 : one.f2;
    const step = (1e-3 * Math.hypot(...plane.cell)) / (Math.hypot(...field) || 1);
    const ends = [1, -1].map((way) => one.x.map((v, e) => v + way * step * field[e]));
    const [ahead, behind] = plane.at(ends);
    const bend = one.fold === 1 ? ahead.l1 - behind.l1 : ahead.l2 - behind.l2;
    const visible = bend * one.fold > 0;
    return {
      type: "fold",
      side: one.fold,
      x: one.x,
      visible,
      kind: `${visible ? "visible" : "invisible"} fold`,
    };
  }

  function kindOfEquilibrium([[a, b], [c, d]]) {
    const [trace, det] = [a + d, a * d - b * c];
    if (det < 0) return "saddle";
    if (Math.abs(trace) < 1e-7 * (Math.abs(a) + Math.abs(b) + Math.abs(c) + Math.abs(d)))
      return "centre";
    return `${trace < 0 ? "stable" : "unstable"} ${trace * trace >= 4 * det ? "node" : "focus"}`;
  }

  /** Newton's method for an equilibrium of the field of a side; null where it does not converge. */
  function equilibriumNear(plane, start, sign) {
    let x = start;
    const [du, dv] = plane.cell;
    const e = [1e-6 * du, 1e-6 * dv];
    for (let round = 0; round < 15; round++) {
      const [u, v] = x;
      const around = [x, [u + e[0], v], [u - e[0], v], [u, v + e[1]], [u, v - e[1]]];
      const values = plane.sampled(around, sign);
      const f = around.map((_, k) => [values[k * plane.row], values[k * plane.row + 1]]);
      const jacobian = [0, 1].map((q) => [
        (f[1][q] - f[2][q]) / (2 * e[0]),
        (f[3][q] - f[4][q]) / (2 * e[1]),
      ]);
      const [[a, b], [c, d]] = jacobian;
      const det = a * d - b * c;
      if (!(Math.abs(det) > 1e-14)) return null;
      const [r, s] = f[0];
      const step = [(d * r - b * s) / det, (a * s - c * r) / det];
      x = [u - step[0], v - step[1]];
      if (Math.abs(step[0] / du) + Math.abs(step[1] / dv) < 1e-9) return { x, jacobian };
    }
    return null;
  }

  /** Equilibria of the field of a side in the box, on their own side of the surface. */
  function equilibria(plane, sign, cells) {
    const [a, b, c, d] = plane.box;
    const n = cells + 1;
    const points = grid(plane.box, cells);
    const values = plane.sampled(points, sign);
    const { row } = plane;
    /** Whether a component of the field changes its sign in the cell of a corner. */
    const changes = (k, e) => {
      let positive = 0;
      for (const corner of [k, k + 1, k + n, k + n + 1]) positive += values[corner * row + e] > 0;
      return positive > 0 && positive < 4;
    };
    const found = [];
    for (let k = 0; k < points.length - n; k++) {
      if (k % n === cells || !changes(k, 0) || !changes(k, 1)) continue;
      const start = [0, 1].map((e) => (points[k][e] + points[k + n + 1][e]) / 2);
      const one = equilibriumNear(plane, start, sign);
      if (!one) continue;
      const [u, v] = one.x;
      const inside = u >= a && u <= b && v >= c && v <= d;
      const own = !plane.engine.width || plane.heights([one.x])[0] * sign > 0;
      if (!inside || !own || found.some((other) => plane.apart(other, one) < 0.01)) continue;
      found.push({
        type: "equilibrium",
        side: sign,
        x: one.x,
        kind: kindOfEquilibrium(one.jacobian),
      });
    }
    return found;
  }

  /** Stretches of the surface and points on it in a plane; `cells` each way. */
  function surface(plane, cells = 40) {
    const stretched = [];
    const folds = [];
    for (const chain of zeroLines((points) => plane.heights(points), plane.box, cells)) {
      const line = withFolds(plane, plane.at(chain));
      folds.push(...line.filter((one) => one.fold));
      stretched.push(...stretches(plane, line));
    }
    return { stretches: stretched, folds };
  }

  /** Stretches and special points of a planar system with one surface, whose sliding is Filippov's, or none. */
  function planar(engine, p, box, slides = true) {
    const plane = new Plane(engine, p, box, (x) => x);
    const sides = engine.width ? [1, -1] : [1];
    const marks = sides.flatMap((sign) => equilibria(plane, sign, 40));
    if (!engine.width) return { lines: [], marks };
    const found = surface(plane);
    const lines = found.stretches.map(({ kind, line }) => ({
      kind,
      line: line.map((one) => one.x),
    }));
    if (slides) {
      const sliding = found.stretches.filter(({ kind }) => kind !== "crossing");
      marks.push(...found.folds.map((one) => foldMark(plane, one)));
      marks.push(...sliding.flatMap((own) => pseudoEquilibria(plane, own)));
    }
    return { lines, marks };
  }

  return { Plane, planar, surface, zeroLines };
})();

if (typeof module !== "undefined") module.exports = { Scan };
