// The explorer of two-folds: one state (folds, nu), drawn anew whenever it changes.
"use strict";

(() => {
  const { svg, html, text } = Page;
  const given = Page.data("two-folds");
  const byId = (id) => document.getElementById(id);
  const state = { folds: "II", nu: [-2, -1] };
  const REACH = given.reach;
  const WORDS = {
    VV: "both visible",
    II: "both invisible",
    VI: "visible, invisible",
    IV: "invisible, visible",
  };
  const LETTERS = {
    Delta: "Δ",
    nu1: "ν₁",
    nu2: "ν₂",
    "kappa_-": "κ₋",
    "kappa_+": "κ₊",
    Da: "Dₐ",
    Dr: "Dᵣ",
  };
  /** The words of the table with the letters of the pictures. */
  const say = (words) =>
    words.replace(/Delta|nu[12]|kappa_[-+]|\bD[ar]\b/g, (name) => LETTERS[name]);

  let drawn = "";
  const redraw = () => {
    drawn = "";
    draw();
  };
  const map = new Page.Plane(byId("map"), { x: [-REACH, REACH], y: [-REACH, REACH], redraw });
  const portrait = new Page.Plane(byId("portrait"), { x: [-1, 1], y: [-1, 1], redraw });
  const clamp = (v) => Math.min(Math.max(v, -REACH), REACH);

  function set(changes) {
    Object.assign(state, changes);
    Page.setAddress({
      folds: state.folds,
      nu: state.nu.map((v) => Number(v.toPrecision(8))).join(","),
    });
    refresh();
  }

  // the map of classes -------------------------------------------------------------------------

  const HATCH = { "II-C": "lines", "mix-C": "lines", "VV-F": "dots", "mix-F": "dots" };

  function patterns() {
    const size = { width: 7, height: 7, patternUnits: "userSpaceOnUse" };
    const line = svg("path", { d: "M0 7L7 0", class: "hatch-line" });
    const dot = svg("circle", { cx: 2, cy: 2, r: 0.9, class: "hatch-dot" });
    return svg(
      "defs",
      {},
      svg("pattern", { id: "lines", ...size }, line),
      svg("pattern", { id: "dots", ...size }, dot),
    );
  }

  /** Branch nu1 > 0 or nu1 < 0 of nu1 nu2 = product, within reach. */
  function hyperbola(product, branch) {
    const low = Math.abs(product) / REACH;
    const points = Array.from({ length: 121 }, (_, k) => branch * low * (REACH / low) ** (k / 120));
    return points.map((x) => [x, product / x]);
  }

  function curves(folds) {
    const across = (a, b) => [
      [-REACH, a],
      [REACH, b],
    ];
    if (folds === "VV" || folds === "II") {
      const side = folds === "VV" ? 1 : -1;
      const found = [
        {
          points: hyperbola(1, side),
          look: "edge",
          words: "Δ = 0, a line of equilibria of the sliding flow",
        },
        { points: hyperbola(1, -side), look: "edge harmless", words: "Δ = 0, the class stays" },
      ];
      if (folds === "VV") return found;
      for (const n of [3, 4, 5, 6, 8]) {
        const points = hyperbola(Math.cos(Math.PI / n) ** 2, -1);
        found.push({
          points,
          look: "edge count",
          words: n === 3 && "one flight more is possible beyond",
        });
      }
      const words = "ν = 0, the order of crossings changes";
      return [
        ...found,
        { points: across(0, 0), look: "edge itinerary", words },
        {
          points: [
            [0, -REACH],
            [0, REACH],
          ],
          look: "edge itinerary",
        },
      ];
    }
    const turn = (points) => (folds === "VI" ? points : points.map(([a, b]) => [b, a]));
    return [
      { points: turn(across(2 - REACH, 2 + REACH)), look: "edge", words: "two eigenlines merge" },
      {
        points: turn(hyperbola(-1, -1)),
        look: "edge rank",
        words: "Δ = 0, an eigenvalue vanishes",
      },
      {
        points: turn(across(-2 - REACH, REACH - 2)),
        look: "edge harmless",
        words: "the same, the class stays",
      },
      { points: turn(hyperbola(-1, 1)), look: "edge rank harmless" },
      {
        points: turn(across(0, 0)),
        look: "edge itinerary",
        words: "ν = 0, the order of crossings changes",
      },
    ];
  }

  function key(list, entries) {
    const items = entries.map(([mark, words]) => {
      const box = svg("svg", { viewBox: "0 0 34 14", "aria-hidden": "true" });
      box.append(mark);
      return html("li", {}, box, words);
    });
    list.replaceChildren(...items);
  }

  const stroke = (look) => svg("path", { d: "M1 7H33", class: look, fill: "none" });

  function drawMap() {
    const parts = [patterns()];
    for (const [label, polygon] of given.areas[state.folds]) {
      parts.push(map.polygon(polygon, { class: `class-${label}` }));
      if (HATCH[label]) parts.push(map.polygon(polygon, { fill: `url(#${HATCH[label]})` }));
    }
    parts.push(
      map.path(
        [
          [-REACH, 0],
          [REACH, 0],
        ],
        { class: "zero" },
      ),
    );
    parts.push(
      map.path(
        [
          [0, -REACH],
          [0, REACH],
        ],
        { class: "zero" },
      ),
    );
    const lines = curves(state.folds);
    parts.push(...lines.map((line) => map.path(line.points, { class: line.look })));
    for (const [label, place] of Object.entries(given.positions[state.folds])) {
      parts.push(map.label(place, label, { class: "name halo" }));
    }
    map.layer.replaceChildren(...parts);
    map.ticks("ν₁", "ν₂");
    key(
      byId("map-key"),
      lines.filter((line) => line.words).map((line) => [stroke(line.look), line.words]),
    );
  }

  // the portrait -------------------------------------------------------------------------------

  const toBox = (angle) => {
    const [a, b] = [Math.cos(angle), Math.sin(angle)];
    const size = Math.max(Math.abs(a), Math.abs(b));
    return [a / size, b / size];
  };
  const times = (s, z) => [s * z[0], s * z[1]];

  function regions() {
    const square = (a, b, look) =>
      portrait.polygon(
        [
          [0, 0],
          [a, 0],
          [a, b],
          [0, b],
        ],
        { class: look },
      );
    return [
      square(1, 1, "region-a"),
      square(-1, -1, "region-r"),
      square(-1, 1, "region-c"),
      square(1, -1, "region-c"),
    ];
  }

  /** Hatch the sectors all of whose orbits reach s or come from it, and their mirror images. */
  function shade(parts) {
    const found = [];
    for (const { low, high, orbit } of parts) {
      if (orbit.goesTo !== "s" && orbit.comesFrom !== "s") continue;
      const corner = low < Math.PI / 4 && Math.PI / 4 < high ? [Math.PI / 4] : [];
      const edge = [low, ...corner, high].map(toBox);
      const fill = `url(#${orbit.goesTo === "s" ? "lines" : "dots"})`;
      for (const sign of [1, -1]) {
        found.push(
          portrait.polygon([[0, 0], ...edge.map((z) => times(sign, z))], { fill, opacity: 0.55 }),
        );
      }
    }
    return found;
  }

  /** Scaled copies of a sector's orbit, evenly spaced across the flow, and their images in Dr. */
  function orbits({ low, high, orbit }) {
    if (high - low < 0.02) return [];
    const { points, middle } = orbit;
    const [a, b] = [
      points[Math.max(middle - 1, 0)],
      points[Math.min(middle + 1, points.length - 1)],
    ];
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const angle = (low + high) / 2;
    const across = Math.abs(dx * Math.sin(angle) - dy * Math.cos(angle)) / Math.hypot(dx, dy);
    const spacing = 0.17 / Math.max(across, 0.25);
    const count = Math.min(Math.ceil(3 / spacing), 28);
    const found = [];
    for (let k = 0; k < count; k++) {
      const scale = spacing * (0.5 + k);
      const copy = points.map((z) => times(scale, z)).filter((z) => Math.max(z[0], z[1]) < 40);
      const mirrored = copy.map((z) => times(-1, z)).reverse();
      for (const [curve, which] of [
        [copy, "a"],
        [mirrored, "r"],
      ]) {
        found.push(portrait.path(curve, { class: `orbit orbit-${which}` }));
        const seen = curve.filter((z) => Math.abs(z[0]) <= 1 && Math.abs(z[1]) <= 1);
        const length = seen
          .slice(1)
          .reduce((l, z, i) => l + Math.hypot(z[0] - seen[i][0], z[1] - seen[i][1]), 0);
        if (length > 0.16) found.push(portrait.arrow(seen, 0.5, { class: `head-${which}` }, 4.5));
      }
    }
    return found;
  }

  /** Orbits that pass through the surface: in along one field, out along the other. */
  function crossings(f) {
    const [s1, s2] = f.sigma;
    const [n1, n2] = f.nu;
    const unit = (v) => times(1 / Math.hypot(...v), v);
    const [above, below] = [unit([-s1, n1]), unit([n2, s2])];
    const found = [];
    for (const place of [
      [-0.32, 0.8],
      [-0.8, 0.32],
      [-0.42, 0.42],
    ]) {
      for (const sign of [1, -1]) {
        const z = times(sign, place);
        const [came, goes] = sign > 0 ? [below, above] : [above, below];
        const [first, second] = sign > 0 ? [2, 1] : [1, 2];
        const before = [z[0] - 0.13 * came[0], z[1] - 0.13 * came[1]];
        const after = [z[0] + 0.15 * goes[0], z[1] + 0.15 * goes[1]];
        const [x, y] = portrait.at(z);
        found.push(
          portrait.path([before, z], { class: `pass-${first}` }),
          portrait.path([z, after], { class: `pass-${second}` }),
          portrait.arrow([z, after], 0.9, { class: `fill-${second}` }, 4),
          svg("circle", { cx: x, cy: y, r: 3.2, class: "two-fold" }),
        );
      }
    }
    return found;
  }

  function folds() {
    const ends = [
      [
        [0, -1],
        [0, 1],
      ],
      [
        [-1, 0],
        [1, 0],
      ],
    ];
    return ends.map((points, k) => {
      const hidden = state.folds[k] === "I" ? " invisible" : "";
      return portrait.path(points, { class: `fold fold-${k + 1}${hidden}` });
    });
  }

  const ZERO = 1e-9;
  const lineKind = (value) => (Math.abs(value) < ZERO ? "rest" : value < 0 ? "canard" : "faux");

  /** Eigenlines in the sliding regions, with their names, and those outside. */
  function lines(f) {
    const found = [];
    for (const { value, slope } of TwoFolds.eigenlines(f)) {
      const kind = lineKind(value);
      const end = toBox(Math.atan(slope));
      const whole = [times(-1, end), end];
      found.push(
        portrait.path(whole, {
          class: `eigenline line-${kind}`,
          "data-value": value,
          "data-slope": slope,
        }),
      );
      if (kind === "rest") continue;
      const ways = value < 0 ? [end, times(-1, end)] : [times(-1, end), end];
      for (const at of [0.24, 0.78])
        found.push(portrait.arrow(ways, at, { class: `word-${kind}` }, 7));
      const words = kind === "canard" ? "canard" : "faux canard";
      const turn = (Math.atan(slope) * 180) / Math.PI;
      const [x, y] = portrait.at(times(-0.66, end));
      const shift = slope >= 1 ? -8 : 17;
      const place = `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${(-turn).toFixed(1)}) translate(0 ${shift})`;
      found.push(
        svg(
          "text",
          { transform: place, "text-anchor": "middle", class: `halo word-${kind}` },
          words,
        ),
      );
    }
    for (const slope of f.slopes.filter((m) => m < 0)) {
      const end = toBox(Math.atan(slope));
      found.push(portrait.path([times(-1, end), end], { class: "line-virtual" }));
    }
    return found;
  }

  /** Invariant lines of the flights around an invisible two-fold, with their images by a flight. */
  function diabolo() {
    const slopes = TwoFolds.diabolo(state.folds, state.nu);
    if (!slopes) return [];
    return slopes.flatMap((slope, k) => {
      const start = [-1, slope];
      const landed = [1, slope + 2 * state.nu[0]];
      return [start, landed].map((z) => {
        const end = times(1 / Math.max(Math.abs(z[0]), Math.abs(z[1])), z);
        return portrait.path([[0, 0], end], { class: k ? "line-shrinks" : "line-grows" });
      });
    });
  }

  function names(parts) {
    const widest = parts.reduce((a, b) => (b.high - b.low > a.high - a.low ? b : a));
    const middle = times(0.84, toBox((widest.low + widest.high) / 2));
    const [x, y] = portrait.at([0, 0]);
    const name = (z, words) => portrait.label(z, words, { class: "name halo" }, [0, 5]);
    return [
      name(middle, "Dₐ"),
      name(times(-1, middle), "Dᵣ"),
      name([-0.86, 0.88], "C₁"),
      name([0.86, -0.88], "C₂"),
      svg("circle", { cx: x, cy: y, r: 5.5, class: "two-fold" }),
    ];
  }

  function drawPortrait(f) {
    const parts = TwoFolds.sectors(f);
    portrait.under.replaceChildren(...regions(), ...shade(parts));
    portrait.layer.replaceChildren(
      ...crossings(f),
      ...diabolo(),
      ...parts.flatMap(orbits),
      ...folds(),
      ...lines(f),
      ...names(parts),
    );
    portrait.ticks("z₂", "z₃");
    const entries = [0, 1].map((k) => {
      const hidden = state.folds[k] === "I";
      return [
        stroke(`fold fold-${k + 1}${hidden ? " invisible" : ""}`),
        `fold of F${"₁₂"[k]}, ${hidden ? "in" : ""}visible`,
      ];
    });
    for (const { value } of TwoFolds.eigenlines(f)) {
      const kind = lineKind(value);
      const words = {
        canard: "canard",
        faux: "faux canard",
        rest: "equilibria of the sliding flow",
      }[kind];
      entries.push([
        stroke(`line-${kind}`),
        kind === "rest" ? words : `${words}, κ = ${text(value)}`,
      ]);
    }
    if (f.slopes.some((m) => m < 0))
      entries.push([stroke("line-virtual"), "eigenline outside sliding"]);
    entries.push(
      [stroke("orbit-a"), "sliding, attracting"],
      [stroke("orbit-r"), "sliding, repelling"],
    );
    entries.push(
      [stroke("pass-1"), "orbits above the surface"],
      [stroke("pass-2"), "orbits below"],
    );
    const square = (id) =>
      svg("rect", { x: 1, y: 1, width: 32, height: 12, fill: `url(#${id})`, class: "frame-key" });
    if (parts.some((p) => p.orbit.goesTo === "s"))
      entries.push([square("lines"), "all run Dₐ → s → Dᵣ"]);
    if (parts.some((p) => p.orbit.comesFrom === "s"))
      entries.push([square("dots"), "all run Dᵣ → s → Dₐ"]);
    if (TwoFolds.diabolo(state.folds, state.nu)) {
      entries.push(
        [stroke("line-shrinks"), "flights shrink to s"],
        [stroke("line-grows"), "flights grow"],
      );
    }
    key(byId("portrait-key"), entries);
  }

  // words --------------------------------------------------------------------------------------

  const many = (n) => (n === Infinity ? "infinitely many" : n === 0 ? "none" : text(n));

  function drawWords(f, found) {
    const boundary = Boolean(found.between);
    const label = say(
      found.label.replace(/^boundary ([^:]*): (.*)$/, "$1, between $2").replaceAll(/[|](?=.*[|])/g, ", ").replace("|", " and "),
    );
    byId("label").textContent = `${boundary ? "On a boundary: " : "Class "}${label}`;
    byId("determinism").textContent = boundary
      ? `The classes ${found.between.join(", ")} meet here and leading order does not decide between them; higher derivatives do.`
      : say(found.row.determinism);
    const names = found.boundaries.map(say).join(", ");
    byId("meets").textContent =
      names && !boundary ? `On ${names}, which leaves the class unchanged.` : "";
    const pair = (values) =>
      values.length ? values.map((v) => text(v, 6)).join(" and ") : "complex: no eigenlines";
    const facts = {
      σ: `(${f.sigma.map((s) => (s > 0 ? "+1" : "−1")).join(", ")})`,
      "eigenvalues κ": pair(f.eigenvalues),
      "slopes z₃/z₂": pair(f.slopes),
      canards: many(found.canards),
      "faux canards": many(found.fauxCanards),
      flights: `at most ${many(TwoFolds.maxFlights(state.folds, state.nu)).replace("none", "0")}`,
      "trace, Δ": `${text(f.trace)}, ${text(f.determinant)}`,
      "next boundary": found.nearest
        ? `${say(found.nearest)}, relative distance ${text(found.margin, 2)}`
        : "none",
    };
    if (facts.flights.endsWith("many")) facts.flights = "infinitely many";
    const rows = Object.entries(facts).flatMap(([name, value]) => [
      html("dt", {}, name),
      html("dd", {}, value),
    ]);
    byId("facts").replaceChildren(...rows);
    byId("portrait-text").textContent =
      `${label}, folds ${WORDS[state.folds]}. Canards (Dₐ → s → Dᵣ): ${many(found.canards)}; ` +
      `faux canards (Dᵣ → s → Dₐ): ${many(found.fauxCanards)}.`;
  }

  // inputs -------------------------------------------------------------------------------------

  const radios = Object.keys(TwoFolds.SIGMA).map((folds) => {
    const input = html("input", { type: "radio", name: "folds", value: folds });
    input.addEventListener("change", () => set({ folds }));
    byId("kinds").append(html("label", {}, input, `${folds}: ${WORDS[folds]}`));
    return input;
  });
  const moveHandle = Page.draggable(map, {
    name: "ν₁ and ν₂",
    steps: [0.05, 0.05],
    get: () => state.nu,
    set: (nu) => set({ nu }),
    say: () => `ν₁ = ${text(state.nu[0])}, ν₂ = ${text(state.nu[1])}`,
  });
  const fields = [0, 1].map((k) =>
    Page.numberInput(byId("inputs"), {
      id: `nu${k + 1}`,
      name: `ν${"₁₂"[k]}`,
      title: k ? "of the field below" : "of the field above",
      min: -REACH,
      max: REACH,
      step: 0.01,
      get: () => state.nu[k],
      set: (value) => set({ nu: state.nu.map((v, i) => (i === k ? value : v)) }),
    }),
  );
  const cases = byId("cases");
  cases.append(html("option", { value: "" }, "a class, or a boundary between classes"));
  given.cases.forEach(([name], k) => cases.append(html("option", { value: k }, name)));
  cases.addEventListener("change", () => {
    const chosen = given.cases[Number(cases.value)];
    if (cases.value !== "") set({ folds: chosen[1], nu: [...chosen[2]] });
  });

  function draw() {
    const f = TwoFolds.flow(state.folds, state.nu);
    if (drawn !== state.folds) drawMap();
    drawn = state.folds;
    drawPortrait(f);
    drawWords(f, TwoFolds.classify(given.table, state.folds, state.nu));
    moveHandle();
    fields.forEach((update) => update());
    for (const radio of radios) radio.checked = radio.value === state.folds;
    const here = given.cases.findIndex(
      ([, folds, nu]) => folds === state.folds && nu.every((v, k) => v === state.nu[k]),
    );
    cases.value = here >= 0 ? here : "";
    document.documentElement.dataset.ready = "yes";
  }

  const refresh = Page.eachFrame(draw);

  function read() {
    const asked = Page.address();
    const values = (asked.nu || "").split(",").map(Number);
    const read = {
      folds: Object.hasOwn(TwoFolds.SIGMA, asked.folds ?? ""),
      nu: asked.nu && values.length === 2 && values.every(Number.isFinite),
    };
    if (read.folds) state.folds = asked.folds;
    if (read.nu) state.nu = values.map(clamp);
    Page.leftOut(asked, read);
    refresh();
  }

  byId("version").textContent = given.version;
  window.addEventListener("hashchange", read);
  read();
})();
