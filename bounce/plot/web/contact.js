// One bounce by the library's driver, as bounce.simulate does it: the phase before the first load, then the contact.
"use strict";

class Contact {
  static TOLERANCE = 1e-10;
  static LONGEST = 100; // time, as bounce.simulate's t_max
  static INSTANT = 1e-13; // a phase F that is shorter is passed by one Euler step
  static AHEAD = Array.from({ length: 25 }, (_, k) => 1e-17 * 4 ** k); // times at which the load is evaluated
  static SURFACE = 1e-9; // a ball this near to y = 0 that moves up is back at the surface
  static REST = 1e-12; // relative to how it came and how deep it is, a slower ball has come to rest
  static STOPPED = 1;
  static NON_UNIQUE = 2;

  /** The model of a convention of the load: its systems are those of the page with this name. */
  static async of(load, given) {
    const names = ["touching", "free", "forces"].map((part) => `${load}-${part}`);
    return new Contact(given, ...(await Promise.all(names.map((name) => Engine.of(name)))));
  }

  constructor(given, touching, free, forces) {
    Object.assign(this, { given, touching, free, forces });
    this.inertia = given.parameters.indexOf("inertia");
  }

  /** Parameters in the order of the systems. */
  values(p) {
    return this.given.parameters.map((name) => p[name]);
  }

  start({ xdot, ydot, omega }) {
    return [0, xdot, 0, ydot, omega, ...this.given.further];
  }

  /** Values at states: rates without friction, the lift-off function. */
  freely(states, p) {
    const { free } = this;
    const n = free.system.n;
    const rows = free.sample(Float64Array.from(states.flat()), p, []);
    return states.map((_, k) => {
      const row = rows.subarray(k * free.row, (k + 1) * free.row);
      return { field: Array.from(row.subarray(0, n)), load: row[n] };
    });
  }

  /** When the load of a landing becomes positive: at once, within an instant, or after a phase without friction. */
  rise(x, p) {
    const [{ field, load }] = this.freely([x], p);
    if (load > 0) return { kind: "at once" };
    const states = Contact.AHEAD.map((t) => x.map((v, i) => v + t * field[i]));
    const ahead = this.freely(states, p).map((one) => one.load);
    const first = ahead.findIndex((one) => one > 0);
    const isZero = load === 0 && first >= 0 && ahead.slice(0, first).every((one) => one >= 0);
    if (isZero) return { kind: "at once" };
    if (first >= 0 && Contact.AHEAD[first] < Contact.INSTANT) return { kind: "instant" };
    return { kind: "later", longest: first < 0 ? Infinity : Contact.AHEAD[first] / 8 };
  }

  /** The phase F, if there is one: state and time at its end, its points, or why there is none. */
  approach(x, p, kept) {
    const { kind, longest } = this.rise(x, p);
    if (kind === "at once") return { x, t: 0 };
    const later = x.map((v, i) => (i === 0 || i === 2 ? v + Contact.INSTANT * x[i + 1] : v));
    if (kind === "instant") return { x: later, t: 0 };
    const options = { tEnd: Contact.LONGEST, tol: Contact.TOLERANCE, maxStep: longest };
    const run = this.free.simulate(x, p, options);
    if (run.status !== Contact.STOPPED)
      return { fault: "no lift-off: the surface does not push the ball up" };
    const [, , y, ydot] = run.x;
    if (y > -Contact.SURFACE && ydot > 0) {
      return { fault: "the ball is back before the surface presses on it" };
    }
    const phases = kept
      ? this.phases(run, this.free, p, "F")
      : [{ mode: "F", start: 0, end: run.t }];
    return { x: this.ontoZeroLoad([...run.x], p), t: run.t, phases };
  }

  /** Move along the motion until the load is zero to rounding. */
  ontoZeroLoad(x, p) {
    let moved = x;
    for (let round = 0; round < 3; round++) {
      const [here] = this.freely([moved], p);
      const e = 1e-6;
      const [ahead] = this.freely([moved.map((v, i) => v + e * here.field[i])], p);
      const rate = (ahead.load - here.load) / e;
      moved = moved.map((v, i) => v - (here.load / rate) * here.field[i]);
    }
    return moved;
  }

  /** Whether a ball whose load ended is at rest, with a load of rounding errors only. */
  rests(x, landing) {
    const size = Math.max(Math.abs(x[2]), Math.abs(landing[3]));
    return Math.abs(x[3]) <= Contact.REST * size;
  }

  /** Bounce a ball once; with `kept` the phases have points {t, x, ..., load, friction, slip, angle}. */
  simulate(surface, landing, kept = false) {
    const p = this.values(surface);
    const start = this.start(landing);
    const none = (fault) => ({ fault, phases: [], itinerary: "", lastMode: "" });
    if (!(landing.ydot < 0)) return none("the ball does not approach the ground");
    const { x, t, phases: before = [], fault } = this.approach(start, p, kept);
    if (fault) return none(fault);
    const options = { tStart: t, tEnd: Contact.LONGEST, tol: Contact.TOLERANCE };
    let run = this.touching.simulate(x, p, options);
    if (before.length && run.status === Contact.NON_UNIQUE && run.t === t) {
      run = this.touching.simulate(x, p, { ...options, startMode: "s" });
    }
    if (run.status !== Contact.STOPPED) {
      const why = run.status ? "the motion is not unique" : "the ball stays in the ground";
      return none(`no lift-off: ${why}`);
    }
    if (this.rests(run.x, start)) return none("no lift-off: the ball stays in the ground");
    const phases = [...before, ...this.phases(run, this.touching, kept ? p : null)];
    return {
      ...this.lifted(run.x),
      time: run.t,
      phases,
      ...named(phases.map((phase) => phase.mode)),
    };
  }

  lifted([x, xdot, y, ydot, omega]) {
    return { fault: "", liftOff: { x, xdot, y, ydot, omega }, slip: xdot + omega };
  }

  /** Phases of a run; with parameters they have points. */
  phases(run, engine, p, only) {
    const found = [];
    const steps = Array.from({ length: run.steps }, (_, k) => [
      run.starts[k],
      k + 1 < run.steps ? run.starts[k + 1] : run.t,
    ]);
    steps.forEach(([start, end], k) => {
      const mode = only ?? (run.stepModes[k] || "*");
      if (found.at(-1)?.mode !== mode) found.push({ mode, start, end, points: [] });
      const phase = found.at(-1);
      phase.end = end;
      const count = Math.max(3, Math.ceil((90 * (end - start)) / (run.t - run.starts[0])));
      for (let q = phase.points.length ? 1 : 0; p && q <= count; q++) {
        const s = ((end - start) * q) / count;
        const { x, rates } = Engine.onStep(run, engine.system, k, s);
        phase.points.push({ t: start + s, x, rates });
      }
    });
    return p
      ? found.map((phase) => ({ ...phase, points: this.described(phase.points, p) }))
      : found;
  }

  /** Points with their forces: the load by its own function, friction by what it does to the spin. */
  described(points, p) {
    const { forces } = this;
    const states = Float64Array.from(points.flatMap(({ x }) => x));
    const rows = forces.sample(states, p, []);
    return points.map(({ t, x: [x, xdot, y, ydot, omega], rates }, k) => {
      const load = rows[k * forces.row + forces.system.n];
      return {
        t,
        x,
        xdot,
        y,
        ydot,
        omega,
        load,
        friction: p[this.inertia] * rates[4],
        slip: xdot + omega,
      };
    });
  }

  /** Lift-offs of many landings, without their phases: itinerary and last mode, or a fault. */
  many(surface, landings) {
    const p = this.values(surface);
    const starts = landings.map((landing) => this.start(landing));
    const loads = this.freely(starts, p).map((one) => one.load);
    const atOnce = [...landings.keys()].filter((k) => loads[k] > 0);
    const found = landings.map((landing, k) =>
      loads[k] > 0 ? null : this.simulate(surface, landing),
    );
    const x0 = Float64Array.from(atOnce.flatMap((k) => starts[k]));
    const parameters = Float64Array.from(atOnce.flatMap(() => p));
    const options = { tEnd: Contact.LONGEST, tol: Contact.TOLERANCE };
    const made = this.touching.many(x0, parameters, options);
    const d = this.touching.system.dimension;
    atOnce.forEach((k, q) => {
      const x = made.x.subarray(q * d, (q + 1) * d);
      const isLifted = made.status[q] === Contact.STOPPED && !this.rests(x, starts[k]);
      found[k] = isLifted
        ? named(made.itinerary[q].split(" "))
        : { fault: "no lift-off", itinerary: "", lastMode: "" };
    });
    return found;
  }

  /** +1 where a ball lifts off in forward slip, -1 in reverse slip, 0 in rolling, NaN if not at all. */
  side(surface, landing) {
    const [{ lastMode }] = this.many(surface, [landing]);
    return { "+": 1, "-": -1, s: 0 }[lastMode] ?? NaN;
  }

  /** Landing between two of opposite sides at which the side changes: bisection. */
  divide(surface, ydot, a, b, tolerance) {
    let [low, high] = [a, b];
    const first = this.side(surface, { xdot: a[0], ydot, omega: a[1] });
    for (;;) {
      const middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
      const apart = Math.hypot(high[0] - low[0], high[1] - low[1]);
      const isEnd = [low, high].some((end) => end[0] === middle[0] && end[1] === middle[1]);
      if (!(apart > tolerance) || isEnd) return middle;
      const here = this.side(surface, { xdot: middle[0], ydot, omega: middle[1] });
      if (here === 0) return middle;
      if (here === first) low = middle;
      else high = middle;
    }
  }
}

/** Itinerary and last mode of phases. */
function named(modes) {
  return { itinerary: modes.join(" "), lastMode: modes.at(-1) };
}

/** Name of a region by the itinerary in it, as bounce.maps writes it. */
function regionName(itinerary) {
  const words = { "+": "S+", "-": "S-", s: "R" };
  return itinerary
    .split(" ")
    .map((mode) => words[mode] || mode)
    .join(" ");
}
