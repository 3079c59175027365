// The classes of two-folds in the browser: nonsmooth/local/two_folds, whose words come with the page.
//
// Da is attracting sliding (z2, z3 > 0), Dr repelling, s the two-fold at the origin. Sliding orbits are
// those of dz/dr = M z; M has the entries nu2, -sigma1 and sigma2, nu1. tests/plot/test_explorer.py
// compares every function here with Python's.
"use strict";

const TwoFolds = (() => {
  const SIGMA = { VV: [1, -1], II: [-1, 1], VI: [1, 1], IV: [-1, -1] };
  const KINDS = {
    VV: "visible",
    II: "invisible",
    VI: "visible-invisible",
    IV: "visible-invisible",
  };
  const COUNT = { none: 0, one: 1, all: Infinity, sector: Infinity };
  const mixed = (folds) => folds === "VI" || folds === "IV";
  const negative = (x) => x < 0 || Object.is(x, -0);
  const withSign = (size, x) => (negative(x) ? -size : size);

  /** The linear flow that draws the sliding orbits: its invariants, eigenvalues and slopes z3/z2. */
  function flow(folds, nu) {
    const sigma = SIGMA[folds];
    const [s1, s2] = sigma;
    const [n1, n2] = nu;
    const trace = n1 + n2;
    const determinant = n1 * n2 + s1 * s2;
    const discriminant = (n1 - n2) ** 2 - 4 * s1 * s2;
    const found = { folds, sigma, nu, trace, determinant, discriminant };
    found.gap = s1 * (n2 - n1);
    found.matrix = [
      [n2, -s1],
      [s2, n1],
    ];
    if (discriminant < 0) return { ...found, eigenvalues: [], slopes: [] };
    const root = Math.sqrt(discriminant);
    const large = trace / 2 + withSign(root / 2, trace / 2);
    // the small one from the product: no cancellation
    found.eigenvalues = [large ? determinant / large : 0, large].sort((a, b) => a - b);
    const steep = -(n1 - n2 + withSign(root, n1 - n2)) / (2 * s1);
    found.slopes = [steep, s2 / (s1 * steep)].sort((a, b) => s1 * (b - a));
    return found;
  }

  const HOLDS = {
    "VV-C1": (f) => f.eigenvalues[0] < 0,
    "VV-F": (f) => f.eigenvalues[0] > 0,
    "II-C": (f) => f.eigenvalues[1] < 0,
    "II-F": (f) => f.eigenvalues[1] > 0,
    "mix-0": (f) => f.gap < 2,
    "mix-S": (f) => f.gap > 2 && f.determinant < 0,
    "mix-C": (f) => f.gap > 2 && f.determinant > 0 && f.trace < 0,
    "mix-F": (f) => f.gap > 2 && f.determinant > 0 && f.trace > 0,
  };

  /** The row of the decision table that holds, or undefined on a boundary. */
  function row(table, f) {
    return table.find((r) => r.folds.includes(f.folds) && HOLDS[r.label](f));
  }

  /** Relative distance to each boundary of the kind, and the classes that meet there. */
  function boundaries(table, f, tol) {
    const [n1, n2] = f.nu;
    const node = f.trace < 0 ? "mix-C" : "mix-F";
    const size = Math.max(1, Math.abs(n1), Math.abs(n2));
    const found = [];
    let between;
    if (mixed(f.folds)) {
      const changes = f.gap > 0;
      const distance = Math.abs(f.gap - (changes ? 2 : -2)) / Math.max(2, size);
      found.push({ distance, name: "disc=0", between: changes ? ["mix-0", node] : ["mix-0"] });
      between = f.gap >= 2 - tol * size ? ["mix-S", node] : ["mix-0"];
    } else if (f.folds === "VV") {
      between = f.trace > 0 ? ["VV-C1", "VV-F"] : ["VV-C1"];
    } else {
      between = f.trace < 0 ? ["II-C", "II-F"] : ["II-F"];
    }
    const distance = Math.abs(f.determinant) / Math.max(1, Math.abs(n1 * n2));
    found.push({ distance, name: "Delta=0", between });
    for (const k of [0, 1]) {
      if (f.folds[k] !== "I") continue;
      const here = row(table, f);
      const label = here ? here.label : "";
      found.push({ distance: Math.abs(f.nu[k]) / size, name: `nu${k + 1}=0`, between: [label] });
    }
    return found;
  }

  /** Range of the slopes of the orbits of Da that connect to s. */
  function range(kind, slope, above) {
    if (kind === "none") return [NaN, NaN];
    if (kind === "all") return [0, Infinity];
    if (kind === "one") return [slope, slope];
    return above ? [slope, Infinity] : [0, slope];
  }

  /** Class of a two-fold: label, counts, slopes of what connects, boundaries met, nearest boundary. */
  function classify(table, folds, nu, tol = 1e-9) {
    const f = flow(folds, nu);
    const near = boundaries(table, f, tol);
    const on = near.filter((b) => b.distance <= tol);
    const harmless = (b) => b.between.length === 1;
    const decisive = near.filter((b) => !harmless(b) || b.name.startsWith("nu"));
    const before = (a, b) => a.distance - b.distance || (a.name < b.name ? -1 : 1);
    const closest = [...decisive].sort(before)[0] || { distance: Infinity, name: "" };
    const found = { kind: KINDS[folds], boundaries: on.map((b) => b.name) };
    found.margin = closest.distance;
    found.nearest = closest.name;
    const changing = on.filter((b) => !harmless(b));
    if (changing.length) {
      const all = mixed(folds) && changing.length === 2; // all four meet
      const labels = all
        ? ["mix-0", "mix-S", "mix-C", "mix-F"]
        : [...new Set(changing.flatMap((b) => b.between))];
      const names = changing.map((b) => b.name).join(", ");
      found.label = `boundary ${names}: ${labels.join("|")}`;
      found.between = labels;
      return { ...found, canards: NaN, fauxCanards: NaN, into: [NaN, NaN], outOf: [NaN, NaN] };
    }
    const r = row(table, f);
    const [low, high] = f.slopes;
    found.label = r.label;
    found.row = r;
    found.canards = COUNT[r.into];
    found.fauxCanards = COUNT[r.out_of];
    found.into = range(r.into, low, folds === "IV");
    found.outOf = range(r.out_of, high, folds === "VI");
    return found;
  }

  /** exp(M r) z of a real 2 x 2 matrix, in closed form. */
  function moved(m, r, z) {
    const half = (m[0][0] + m[1][1]) / 2;
    const a = m[0][0] - half;
    const along = [a * z[0] + m[0][1] * z[1], m[1][0] * z[0] - a * z[1]];
    const square = -a * a - m[0][1] * m[1][0]; // minus the squared rate
    const w = Math.sqrt(Math.abs(square));
    let even, odd;
    if (square < 0) {
      // two exponentials: no overflow of one times underflow of the other
      const up = Math.exp((half + w) * r);
      const down = Math.exp((half - w) * r);
      [even, odd] = [(up + down) / 2, (up - down) / (2 * w)];
    } else {
      const scale = Math.exp(half * r);
      [even, odd] = [scale * Math.cos(w * r), scale * (w > 0 ? Math.sin(w * r) / w : r)];
    }
    return [even * z[0] + odd * along[0], even * z[1] + odd * along[1]];
  }

  /** First r > 0 with value c(r) + slope s(r) = 0, c and s the (hyperbolic) cosine and sine. */
  function firstZero(value, slope, square) {
    const w = Math.sqrt(Math.abs(square));
    if (w < 1e-12) return value * slope < 0 ? -value / slope : Infinity;
    if (square > 0) {
      const angle = Math.atan2(-value * w, slope);
      return (((angle % Math.PI) + Math.PI) % Math.PI || Math.PI) / w;
    }
    const ratio = slope ? (-value * w) / slope : Infinity;
    return ratio > 0 && ratio < 1 ? Math.atanh(ratio) / w : Infinity;
  }

  /** Time at which exp(M r) z leaves the open first quadrant, and the coordinate that vanishes. */
  function leaving(m, z) {
    const a = (m[0][0] - m[1][1]) / 2;
    const along = [a * z[0] + m[0][1] * z[1], m[1][0] * z[0] - a * z[1]];
    const square = -a * a - m[0][1] * m[1][0];
    const times = [0, 1].map((i) => firstZero(z[i], along[i], square));
    const component = times[0] <= times[1] ? 0 : 1;
    return { r: times[component], component: times[component] < Infinity ? component : -1 };
  }

  const NEAR = 2e-3; // an orbit so near to s, relative to its start, counts as reaching it
  const FAR = 30;
  const negated = (m) => m.map((line) => line.map((v) => -v));

  /** Points from z to the end of its stay in Da, and what is there: z2=0, z3=0, s or infinity. */
  function stay(m, z, count) {
    const { r, component } = leaving(m, z);
    const start = Math.hypot(...z);
    const points = [z];
    if (component >= 0) {
      for (let k = 1; k <= count; k++) points.push(moved(m, (r * k) / count, z));
      return { points, end: ["z2=0", "z3=0"][component] };
    }
    const rate = Math.max(...m.map((line) => Math.abs(line[0]) + Math.abs(line[1]))) || 1;
    for (let k = 1; k <= 4000; k++) {
      // steps of a fraction of the fastest time scale, then longer: a weak eigenvalue is slow
      const next = moved(m, (0.05 * k * Math.exp(k / 400)) / rate, z);
      const size = Math.hypot(...next);
      if (!Number.isFinite(size)) break;
      points.push(next);
      if (size < NEAR * start) return { points, end: "s" };
      if (size > FAR * start) return { points, end: "infinity" };
    }
    return { points, end: "equilibrium" };
  }

  /** The whole stay in Da of the sliding orbit through a point, in the direction of real time. */
  function orbit(f, z, count = 60) {
    const ahead = stay(f.matrix, z, count);
    const back = stay(negated(f.matrix), z, count);
    const points = [...back.points.slice(1).reverse(), ...ahead.points];
    return { points, comesFrom: back.end, goesTo: ahead.end, middle: back.points.length - 1 };
  }

  /** Eigenlines that lie in the sliding regions: eigenvalue and slope. */
  function eigenlines(f) {
    const found = f.eigenvalues
      .map((value, k) => ({ value, slope: f.slopes[k] }))
      .filter((line) => line.slope > 0);
    const [a, b] = found;
    if (b && Math.abs(a.slope - b.slope) < 1e-4 * a.slope) return [a]; // Jordan block: one line
    return found;
  }

  /** Sectors of Da between eigenlines and folds, each with the orbit through its middle. */
  function sectors(f) {
    const angles = [0, ...eigenlines(f).map((line) => Math.atan(line.slope)), Math.PI / 2];
    angles.sort((a, b) => a - b);
    return angles.slice(1).map((high, k) => {
      const low = angles[k];
      const middle = (low + high) / 2;
      return { low, high, orbit: orbit(f, [Math.cos(middle), Math.sin(middle)]) };
    });
  }

  /** Largest number of flights of an orbit from a crossing region before it slides or goes away. */
  function maxFlights(folds, nu) {
    const invisible = [...folds].filter((letter) => letter === "I").length;
    if (invisible < 2) return invisible;
    const [n1, n2] = nu;
    if (n1 >= 0 || n2 >= 0) return n1 >= 0 && n2 >= 0 ? 1 : 2;
    if (n1 * n2 >= 1) return Infinity;
    return Math.ceil(Math.PI / Math.acos(Math.sqrt(n1 * n2)) - 1e-12) - 1;
  }

  /** Slopes |z3/z2| of the invariant lines of flights: they grow on the first, shrink on the second. */
  function diabolo(folds, nu) {
    const [a, b] = nu.map((v) => -v);
    if (folds !== "II" || a <= 0 || b <= 0 || a * b <= 1 + 1e-12) return null;
    const plus = a * (1 + Math.sqrt(1 - 1 / (a * b)));
    return [a / (b * plus), plus];
  }

  return { SIGMA, KINDS, flow, classify, moved, orbit, eigenlines, sectors, maxFlights, diabolo };
})();
