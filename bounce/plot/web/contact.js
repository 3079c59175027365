// One bounce on the Kelvin-Voigt surface, integrated in the browser as bounce.simulate does in Python:
// Taylor series of the motion, whose coefficients are exact, and events at the first roots of the
// polynomials. tests/bounce/plot/test_explorer.py compares lift-offs with Python's.
//
//   x'' = T + F,  y'' = N - G,  omega' = F / inertia,  T = -(2 d1 eta x' + eta^2 x),  N = -2 d2 y' - y,
//   F = -mu load in forward slip (H = x' + omega > 0), mu load in reverse slip, what holds H = 0 in
//   rolling. The load is N, or N - G for the "net" convention; its downward zero is lift-off.
"use strict";

const Bounce = (() => {
  const ORDER = 24;
  const TOLERANCE = 1e-14;
  const TIE = 1e-12; // of the load: what is nearer to its zero is at it
  const REST = 1e-12; // of the speed of landing: a ball that is slower has come to rest
  const LONGEST = 100; // time, as bounce.simulate's t_max
  const MOST = 200; // phases

  // polynomials --------------------------------------------------------------------------------

  /** Value of the polynomial with coefficients c at t. */
  function value(c, t) {
    let sum = 0;
    for (let k = ORDER; k >= 0; k--) sum = sum * t + c[k];
    return sum;
  }

  /** Row i has C(i, k) / C(ORDER, k): what turns coefficients into those of Bernstein. */
  const TO_BERNSTEIN = (() => {
    const rows = [];
    for (let i = 0; i <= ORDER; i++) {
      const row = new Float64Array(i + 1);
      row[0] = 1;
      for (let k = 1; k <= i; k++) row[k] = (row[k - 1] * (i - k + 1)) / (ORDER - k + 1);
      rows.push(row);
    }
    return rows;
  })();

  const scaled = new Float64Array(ORDER + 1);

  /** Coefficients on [0, h] in Bernstein's basis of the polynomial divided by t^drop. */
  function bernstein(c, h, drop) {
    const b = new Float64Array(ORDER + 1);
    let power = 1;
    for (let k = 0; k <= ORDER; k++) {
      scaled[k] = k + drop <= ORDER ? c[k + drop] * power : 0;
      power *= h;
    }
    for (let i = 0; i <= ORDER; i++) {
      const row = TO_BERNSTEIN[i];
      let sum = 0;
      for (let k = i; k >= 0; k--) sum += row[k] * scaled[k];
      b[i] = sum;
    }
    return b;
  }

  /** How often the sign changes along the coefficients: at least as many roots as inside. */
  function changes(b) {
    let count = 0;
    let last = 0;
    for (const v of b) {
      if (v === 0) continue;
      const sign = v > 0 ? 1 : -1;
      if (last && sign !== last) count++;
      last = sign;
    }
    return count;
  }

  /** Halve the interval (de Casteljau): what is left in b is the right half, the left is returned. */
  function halve(b) {
    const left = new Float64Array(ORDER + 1);
    for (let k = 0; k <= ORDER; k++) {
      left[k] = b[0];
      for (let i = 0; i < ORDER - k; i++) b[i] = 0.5 * (b[i] + b[i + 1]);
    }
    return left;
  }

  /** Root of c / t^drop between low and high, where its sign changes once: safeguarded Newton. */
  function polish(c, drop, low, high, falls) {
    let t = 0.5 * (low + high);
    for (let k = 0; k < 100; k++) {
      let f = 0;
      let slope = 0;
      for (let i = ORDER; i >= drop; i--) {
        slope = slope * t + f;
        f = f * t + c[i];
      }
      if (f === 0) return t;
      if (f < 0 === falls) high = t;
      else low = t;
      let next = t - f / slope;
      if (Math.abs(next - t) <= 1e-16 * Math.abs(t)) return next;
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      if (next === t) return t;
      t = next;
    }
    return t;
  }

  /** First t in (0, h] at which c, divided by t^drop, changes its sign; Infinity if none. */
  function firstRoot(c, h, drop = 0) {
    const pieces = [{ b: bernstein(c, h, drop), low: 0, high: h }];
    while (pieces.length) {
      const { b, low, high } = pieces.pop();
      const count = changes(b);
      if (!count) continue;
      const ends = b[0] * b[ORDER] < 0;
      if (count === 1 && ends) return polish(c, drop, low, high, b[ORDER] < 0);
      if (high - low < 1e-13 * h) {
        if (ends) return 0.5 * (low + high);
        continue; // it touches zero and turns back
      }
      const middle = 0.5 * (low + high);
      const left = halve(b);
      pieces.push({ b, low: middle, high }, { b: left, low, high: middle });
    }
    return Infinity;
  }

  // series of the motion -----------------------------------------------------------------------

  const NAMES = ["x", "xdot", "y", "ydot", "omega", "load", "friction", "slip"];

  function emptySeries() {
    return Object.fromEntries(NAMES.map((name) => [name, new Float64Array(ORDER + 1)]));
  }

  /** Taylor coefficients of the states and forces in a mode: "+", "-", "s" (rolling), "F" (free). */
  function expand(p, mode, state, c) {
    const { d1, d2, eta, mu, inertia, G } = p;
    const lost = p.load === "net" ? G : 0;
    const side = { "+": -mu, "-": mu }[mode];
    for (const name of ["x", "xdot", "y", "ydot", "omega"]) c[name][0] = state[name];
    const { x, xdot, y, ydot, omega, load, friction, slip } = c;
    for (let k = 0; k <= ORDER; k++) {
      const surface = -2 * d2 * ydot[k] - y[k];
      const along = -(2 * d1 * eta * xdot[k] + eta * eta * x[k]);
      load[k] = k ? surface : surface - lost;
      if (mode === "s") friction[k] = (-along * inertia) / (1 + inertia);
      else friction[k] = mode === "F" ? 0 : side * load[k];
      slip[k] = mode === "s" ? 0 : xdot[k] + omega[k];
      if (k === ORDER) break;
      x[k + 1] = xdot[k] / (k + 1);
      xdot[k + 1] = (along + friction[k]) / (k + 1);
      y[k + 1] = ydot[k] / (k + 1);
      ydot[k + 1] = (k ? surface : surface - G) / (k + 1);
      omega[k + 1] = friction[k] / inertia / (k + 1);
    }
  }

  /** Length of a step whose last terms are below the tolerance, relative to the motion's size. */
  function stepLength(c) {
    let size = 0;
    let last = 0;
    let before = 0;
    for (const name of ["x", "xdot", "y", "ydot", "omega"]) {
      size = Math.max(size, Math.abs(c[name][0]), Math.abs(c[name][1]));
      last = Math.max(last, Math.abs(c[name][ORDER]));
      before = Math.max(before, Math.abs(c[name][ORDER - 1]));
    }
    const small = TOLERANCE * (size || 1);
    return Math.min((small / last) ** (1 / ORDER), (small / before) ** (1 / (ORDER - 1)), 4);
  }

  function stateAt(c, t) {
    const names = ["x", "xdot", "y", "ydot", "omega"];
    return Object.fromEntries(names.map((name) => [name, value(c[name], t)]));
  }

  // modes --------------------------------------------------------------------------------------

  /** Sign of the first coefficient that is not zero to rounding, from one on. */
  function firstSign(c, from, scale) {
    for (let k = from; k <= ORDER; k++) {
      if (Math.abs(c[k]) > 1e-15 * scale) return Math.sign(c[k]);
    }
    return 0;
  }

  const spare = emptySeries();

  /** Slack of the friction that holds a rolling ball, against slip to each side. */
  function slack(p, c) {
    const forward = c.load.map((load, k) => p.mu * load + c.friction[k]);
    const reverse = c.load.map((load, k) => p.mu * load - c.friction[k]);
    return { forward, reverse };
  }

  /** Mode that continues from H = 0: rolling where friction can hold, else the side it is pulled to. */
  function decide(p, state) {
    expand(p, "s", state, spare);
    const { forward, reverse } = slack(p, spare);
    const scale = Math.max(Math.abs(state.xdot), Math.abs(state.ydot), 1e-300);
    const [a, b] = [firstSign(forward, 0, scale), firstSign(reverse, 0, scale)];
    if (a >= 0 && b >= 0) return "s";
    return a < 0 ? "+" : "-";
  }

  /** Mode in which contact begins, and how many leading coefficients of the slip are zero there. */
  function begin(p, state) {
    const slip = state.xdot + state.omega;
    if (slip !== 0) return { mode: slip > 0 ? "+" : "-", drop: 0 };
    const mode = decide(p, state);
    if (mode === "s") return { mode, drop: 0 };
    expand(p, mode, state, spare);
    let drop = 1;
    while (drop < 4 && Math.abs(spare.slip[drop]) < 1e-15) drop++;
    return { mode, drop };
  }

  /** What ends a step: the first of the events of the mode, or nothing before h. */
  function nextEvent(p, mode, c, h, drops) {
    let first = { t: h, what: "" };
    const look = (series, drop, what) => {
      const t = firstRoot(series, first.t, drop);
      if (t <= first.t) first = { t, what };
    };
    if (mode === "F") {
      look(c.load, drops.load, "contact");
      look(c.y, drops.y, "surface");
      return first;
    }
    if (mode === "s") {
      const { forward, reverse } = slack(p, c);
      look(forward, drops.load, "+"); // they are zero with a load that begins
      look(reverse, drops.load, "-");
    } else {
      look(c.slip, drops.slip, "zero");
    }
    const exit = first;
    look(c.load, drops.load, "lift-off");
    // friction that holds a ball vanishes with the load: a tie, to rounding, is lift-off
    const left = value(c.load, exit.t);
    const tie =
      mode === "s" && exit.what && left <= TIE * (Math.abs(c.load[0]) + Math.abs(c.load[1]));
    return tie ? { t: exit.t, what: "lift-off" } : first;
  }

  /** Mode and zero coefficients of what follows an event at H = 0. */
  function follow(p, mode, what, state) {
    if (mode === "s") return { mode: what, drop: 2 }; // it leaves tangentially
    expand(p, "s", state, spare);
    const held = Math.abs(spare.friction[0]) < p.mu * spare.load[0];
    if (held) return { mode: "s", drop: 0 };
    return { mode: mode === "+" ? "-" : "+", drop: 1 };
  }

  const fault = (why, phases) => ({ fault: why, phases, itinerary: "", lastMode: "" });

  /** Before the load is positive there is no friction; null if it is so at once. */
  function freeBefore(p, state) {
    expand(p, "F", state, spare);
    const sign = firstSign(spare.load, 0, Math.abs(state.ydot));
    return sign > 0 ? null : { load: spare.load[0] === 0 ? 1 : 0, y: 1 };
  }

  /** Whether the ball has too little energy left of its normal motion to lift off; damping takes more. */
  function stays(p, { y, ydot }, size) {
    if (p.d2 === 0) return false;
    const energy = ydot ** 2 + (y + p.G) ** 2; // about its rest in the ground, twice
    const needed = p.load === "net" ? 0 : p.G ** 2 / (1 + 4 * p.d2 ** 2); // where the load vanishes
    return energy < Math.max(needed * (1 - 1e-9), (REST * size) ** 2);
  }

  /**
   * Bounce a ball once, from touch-down at x = y = 0 to the first downward zero of the load.
   *
   * Returns lift-off (a state), its time, slip, itinerary and last mode, and the phases; with `keep`
   * these have the series from which `at` reads states and forces. `fault` says why there is none.
   */
  function simulate(p, landing, keep = false) {
    if (!(landing.ydot < 0)) return fault("the ball does not approach the ground", []);
    let state = { x: 0, y: 0, ...landing };
    let drops = freeBefore(p, state);
    let mode = "F";
    if (!drops) {
      const start = begin(p, state);
      mode = start.mode;
      // a load that is zero at touch-down rises from there
      drops = {
        slip: start.drop,
        load: 2 * p.d2 * -state.ydot === (p.load === "net" ? p.G : 0) ? 1 : 0,
      };
    }
    const size = Math.max(-landing.ydot, p.G);
    const phases = [{ mode, start: 0, end: 0, steps: [] }];
    let c = emptySeries();
    for (let t = 0; t < LONGEST && phases.length < MOST;) {
      expand(p, mode, state, c);
      const { t: h, what } = nextEvent(p, mode, c, stepLength(c), drops);
      if (stays(p, state, size)) break;
      if (!(h > 0)) return fault("the steps became too small", phases);
      const phase = phases.at(-1);
      state = stateAt(c, h);
      if (keep) {
        phase.steps.push({ start: t, length: h, series: c });
        c = emptySeries();
      }
      t += h;
      phase.end = t;
      if (what === "lift-off") {
        if (state.ydot < REST * size) break; // the load is zero, to rounding, because the ball rests
        return lifted(p, state, t, phases);
      }
      if (what === "surface")
        return fault("the ball is back before the surface presses on it", phases);
      drops = { slip: 0, load: 0, y: 0 };
      if (!what) continue;
      const next = what === "contact" ? begin(p, state) : follow(p, mode, what, state);
      if (what === "contact") drops.load = 1;
      mode = next.mode;
      drops.slip = next.drop;
      phases.push({ mode, start: t, end: t, steps: [] });
    }
    return fault("no lift-off: the ball stays in the ground", phases);
  }

  function lifted(p, state, time, phases) {
    const slip = state.xdot + state.omega;
    const itinerary = phases.map((phase) => phase.mode).join(" ");
    return {
      fault: "",
      liftOff: state,
      time,
      slip,
      itinerary,
      phases,
      lastMode: phases.at(-1).mode,
    };
  }

  /** State, load, friction and slip at times of a phase of a bounce that kept its series. */
  function along(phase, count) {
    const found = [];
    for (const { start, length, series } of phase.steps) {
      const share = Math.max(2, Math.ceil((count * length) / (phase.end - phase.start)));
      for (let k = found.length ? 1 : 0; k <= share; k++) {
        const t = (length * k) / share;
        const point = Object.fromEntries(NAMES.map((name) => [name, value(series[name], t)]));
        found.push({ t: start + t, ...point });
      }
    }
    return found;
  }

  // maps ---------------------------------------------------------------------------------------

  /** Name of a region by the itinerary in it, as bounce.maps writes it. */
  function regionName(itinerary) {
    const words = { "+": "S+", "-": "S-", s: "R" };
    return itinerary
      .split(" ")
      .map((m) => words[m] || m)
      .join(" ");
  }

  /** +1 where a ball lifts off in forward slip, -1 in reverse slip, 0 in rolling, NaN if not at all. */
  function side(p, landing) {
    const { lastMode } = simulate(p, landing);
    return { "+": 1, "-": -1, s: 0 }[lastMode] ?? NaN;
  }

  /** Landing between two of opposite sides at which the side changes: bisection. */
  function divide(p, ydot, a, b, tolerance) {
    let [low, high] = [a, b];
    const first = side(p, { xdot: a[0], ydot, omega: a[1] });
    while (Math.hypot(high[0] - low[0], high[1] - low[1]) > tolerance) {
      const middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
      if (
        (middle[0] === low[0] && middle[1] === low[1]) ||
        (middle[0] === high[0] && middle[1] === high[1])
      )
        break;
      const here = side(p, { xdot: middle[0], ydot, omega: middle[1] });
      if (here === 0) return middle;
      if (here === first) low = middle;
      else high = middle;
    }
    return [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
  }

  return { ORDER, simulate, along, firstRoot, regionName, side, divide };
})();
