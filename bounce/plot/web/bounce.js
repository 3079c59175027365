// The explorer of one bounce: one state (surface, landing), and the pictures that follow it.
"use strict";

(() => {
  const { svg, html, text } = Page;
  const given = Page.data("bounce");
  const byId = (id) => document.getElementById(id);
  const REACH = [3, 6]; // of the map, in xdot and omega
  const FINE = 160;
  const COARSE = 30;
  const state = { ...given.start };

  const RANGES = {
    xdot: { name: "Ẋ", title: "speed along the ground", min: -REACH[0], max: REACH[0], step: 0.01 },
    omega: {
      name: "Ω",
      title: "spin, positive for backspin",
      min: -REACH[1],
      max: REACH[1],
      step: 0.01,
    },
    ydot: { name: "Ẏ", title: "normal speed, downward", min: -3, max: -0.1, step: 0.01 },
    mu: { name: "μ", title: "friction coefficient", min: 0, max: 1.5, step: 0.01 },
    eta: { name: "η", title: "stiffness along / normal (frequencies)", min: 0, max: 3, step: 0.01 },
    d1: { name: "d₁", title: "damping along the ground", min: 0, max: 1, step: 0.01 },
    d2: { name: "d₂", title: "damping normal to it", min: 0, max: 1, step: 0.01 },
    G: { name: "G", title: "gravity", min: 0, max: 0.5, step: 0.001 },
  };
  const LANDING = ["xdot", "omega", "ydot"];
  const SURFACE = ["mu", "eta", "d1", "d2", "G"];
  const NAMES = { "+": "forward", "-": "reverse", s: "rolling", F: "free" };
  const VERBS = {
    "+": "slips forward",
    "-": "slips in reverse",
    s: "rolls",
    F: "feels no friction at first",
  };

  let outcomes = null; // the map that is shown
  const redraw = () => {
    if (outcomes) drawMap(outcomes);
    draw();
  };
  const map = new Page.Plane(byId("map"), {
    x: [-REACH[0], REACH[0]],
    y: [-REACH[1], REACH[1]],
    redraw,
  });
  const cone = new Page.Plane(byId("cone"), { x: [-1, 1], y: [0, 1], redraw });
  const slip = new Page.Plane(byId("slip"), { x: [0, 1], y: [-1, 1], aspect: 0.78, redraw });

  const surface = () => {
    const { mu, eta, d1, d2, G, inertia, load } = state;
    return { mu, eta, d1, d2, G, inertia, load };
  };

  function set(changes) {
    Object.assign(state, changes);
    const shown = Object.entries(state).map(([k, v]) => [
      k,
      typeof v === "number" ? Number(v.toPrecision(8)) : v,
    ]);
    Page.setAddress(Object.fromEntries(shown));
    refresh();
  }

  // the bounce ---------------------------------------------------------------------------------

  function curves(shot) {
    return shot.phases
      .filter((phase) => phase.steps.length)
      .map((phase) => ({ mode: phase.mode, points: Bounce.along(phase, 90) }));
  }

  const extent = (values) =>
    values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);

  function marks(plane, all, read) {
    const points = all.map((curve) => curve.points.map(read));
    const found = [];
    const dot = ([x, y], look) => svg("circle", { cx: x, cy: y, r: 4.6, class: look });
    points.slice(1).forEach((p) => {
      const [x, y] = plane.at(p[0]);
      found.push(svg("rect", { x: x - 4, y: y - 4, width: 8, height: 8, class: "turn" }));
    });
    found.push(dot(plane.at(points[0][0]), "touch"));
    const [x, y] = plane.at(points.at(-1).at(-1));
    found.push(svg("path", { d: `M${x} ${y - 7}l7 7l-7 7l-7 -7z`, class: "off" }));
    return found;
  }

  function drawCone(all) {
    const { mu } = state;
    const points = all.flatMap((curve) => curve.points);
    const top = 1.14 * Math.max(extent(points.map((p) => p.load))[1], 1e-9);
    const bottom = Math.min(0, 1.1 * extent(points.map((p) => p.load))[0]) - 0.06 * top;
    const pushed = Math.max(...points.map((p) => Math.abs(p.friction)));
    const half = Math.max(1.35 * pushed, Math.min(1.35 * mu, 0.6) * top, 1e-6);
    cone.limits([-half, half], [bottom, top]);
    const end = Math.min(top, mu ? half / mu : top);
    const edge = (sign) => [
      [0, 0],
      [sign * mu * end, end],
    ];
    const inside = [
      [0, 0],
      [mu * end, end],
      [mu * end < half ? mu * end : half, top],
    ];
    const mirrored = inside.map(([u, v]) => [-u, v]).reverse();
    const parts = [cone.polygon([...inside, ...mirrored], { class: "cone-inside" })];
    parts.push(...[1, -1].map((sign) => cone.path(edge(sign), { class: "cone-edge" })));
    parts.push(
      cone.path(
        [
          [-half, 0],
          [half, 0],
        ],
        { class: "zero" },
      ),
    );
    const read = (p) => [p.friction, p.load];
    all.forEach(({ mode, points: own }, k) => {
      if (k)
        parts.push(cone.path([read(all[k - 1].points.at(-1)), read(own[0])], { class: "jump" }));
      parts.push(cone.path(own.map(read), { class: `phase phase-${NAMES[mode]}` }));
    });
    for (const { mode, points: own } of all) {
      const line = own.map(read);
      if (length(cone, line) > 30)
        parts.push(cone.arrow(line, 0.45, { class: `head-${NAMES[mode]}` }, 7));
    }
    cone.layer.replaceChildren(...parts, ...marks(cone, all, read));
    cone.ticks("friction force", "load");
  }

  function length(plane, line) {
    const pixels = line.map((p) => plane.at(p));
    return pixels
      .slice(1)
      .reduce((l, p, k) => l + Math.hypot(p[0] - pixels[k][0], p[1] - pixels[k][1]), 0);
  }

  function drawSlip(all, time) {
    const values = all.flatMap((curve) => curve.points.map((p) => p.slip));
    const [low, high] = extent([0, ...values]);
    const room = 0.12 * (high - low || 1);
    slip.limits([0, time], [low - room, high + 1.6 * room]);
    const parts = [];
    all.forEach(({ mode, points }, k) => {
      const [a, b] = [points[0].t, points.at(-1).t];
      if (k)
        parts.push(
          slip.path(
            [
              [a, slip.y[0]],
              [a, slip.y[1]],
            ],
            { class: "band" },
          ),
        );
      const words = { "+": "S+", "-": "S−", s: "R", F: "F" }[mode];
      const wide = slip.at([b, 0])[0] - slip.at([a, 0])[0];
      const look = { class: "name" };
      if (wide > 26) parts.push(slip.label([(a + b) / 2, slip.y[1]], words, look, [0, 18]));
    });
    parts.push(
      slip.path(
        [
          [0, 0],
          [time, 0],
        ],
        { class: "zero" },
      ),
    );
    const read = (p) => [p.t, p.slip];
    for (const { mode, points } of all) {
      parts.push(slip.path(points.map(read), { class: `phase phase-${NAMES[mode]}` }));
    }
    slip.layer.replaceChildren(...parts, ...enlarged(all, high - low));
    slip.over.replaceChildren(...marks(slip, all, read));
    slip.ticks("time", "slip H = Ẋ + Ω");
  }

  /** The last slip in a frame of its own, where it is too small to be seen beside the first. */
  function enlarged(all, range) {
    const { mode, points } = all.at(-1);
    const most = Math.max(...points.map((p) => Math.abs(p.slip)));
    if (all.length < 2 || mode === "s" || most > 0.06 * range || most === 0) return [];
    const { left, top, width, height } = slip.box;
    const words = ["the end,", `slip to ${text(points.at(-1).slip, 2)}`];
    const lines = width < 420 ? words : [words.join(" ")]; // on a phone one line reaches over the curve
    const tall = 0.36 * height + 16 * lines.length;
    const places = [top + 34, top + height - tall - 12].map((y) => ({
      x: left + 0.5 * width,
      y,
      width: 0.46 * width,
      height: 0.36 * height,
    }));
    const covers = ({ x, y }) =>
      all
        .flatMap((phase) => phase.points)
        .map((p) => slip.at([p.t, p.slip]))
        .filter((q) => q[0] > x - 8 && q[1] > y - 8 && q[1] < y + tall + 8).length;
    const box = covers(places[0]) > covers(places[1]) ? places[1] : places[0];
    const [start, end] = [points[0].t, points.at(-1).t];
    const at = (p) => [
      box.x + box.width * (0.08 + (0.84 * (p.t - start)) / (end - start || 1)),
      box.y + box.height * (0.5 - (0.4 * p.slip) / most),
    ];
    const pixels = points.map((p) =>
      at(p)
        .map((v) => v.toFixed(1))
        .join(" "),
    );
    const below = (k) => ({
      x: box.x + box.width,
      y: box.y + box.height + 15 + 15 * k,
      "text-anchor": "end",
      class: "halo",
    });
    return [
      svg("rect", { ...box, class: "inset" }),
      svg("path", { d: `M${box.x} ${box.y + box.height / 2}h${box.width}`, class: "zero" }),
      svg("path", {
        d: `M${pixels.join("L")}`,
        fill: "none",
        class: `phase end phase-${NAMES[mode]}`,
      }),
      ...lines.map((line, k) => svg("text", below(k), line)),
    ];
  }

  // words --------------------------------------------------------------------------------------

  const listed = (words) =>
    words.length < 2 ? words.join("") : `${words.slice(0, -1).join(", ")}, then ${words.at(-1)}`;
  const degrees = (s) => (Math.atan2(s.ydot, s.xdot) * 180) / Math.PI;

  function drawWords(shot) {
    if (shot.fault) {
      byId("verdict").textContent = "No lift-off";
      byId("story").textContent = `There is none to show: ${shot.fault}.`;
      byId("facts").replaceChildren();
      byId("cone-text").textContent = byId("slip-text").textContent = "";
      return;
    }
    const { liftOff, time, itinerary } = shot;
    const leaves = { "+": "forward slip", "-": "reverse slip", s: "rolling" }[shot.lastMode];
    byId("verdict").textContent = Bounce.regionName(itinerary).replaceAll("-", "−");
    byId("story").textContent =
      `The ball ${listed(itinerary.split(" ").map((m) => VERBS[m]))}, and leaves ${
        shot.lastMode === "s" ? "" : "in "
      }${leaves}.`;
    const facts = {
      "slip at lift-off": text(shot.slip, 6),
      "time to lift-off": text(time, 6),
      "speed along": text(liftOff.xdot, 6),
      "normal speed": text(liftOff.ydot, 6),
      spin: text(liftOff.omega, 6),
      angle: `${text(degrees(liftOff))}° above +x`,
      restitution: text(-liftOff.ydot / state.ydot),
    };
    const rows = Object.entries(facts).flatMap(([name, value]) => [
      html("dt", {}, name),
      html("dd", {}, value),
    ]);
    byId("facts").replaceChildren(...rows);
    const turns = shot.phases
      .slice(1)
      .map((phase) => `${VERBS[phase.mode]} from t = ${text(phase.start)}`);
    byId("slip-text").textContent =
      `It lands with slip ${text(state.xdot + state.omega)}; ${[...turns, `lift-off at t = ${text(time)}`].join("; ")}.`;
    byId("cone-text").textContent =
      "In slip the friction lies on an edge of the cone, in rolling inside it. Dot: touch-down; " +
      "squares: changes; diamond: lift-off. Along a thin line friction jumps.";
  }

  function coneKey(shot) {
    const modes = [...new Set(shot.phases.map((phase) => phase.mode))];
    const items = modes.map((mode) => {
      const line = svg("path", { d: "M1 7H33", class: `phase phase-${NAMES[mode]}`, fill: "none" });
      return html(
        "li",
        {},
        svg("svg", { viewBox: "0 0 34 14", "aria-hidden": "true" }, line),
        VERBS[mode],
      );
    });
    byId("cone-key").replaceChildren(...items);
  }

  // the map ------------------------------------------------------------------------------------

  const luminance = (colour) => {
    const parts = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16) / 255);
    const linear = parts.map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const spare = {}; // colours of itineraries without one of their own, kept while sliders move
  const bare = (name) => name.replace(/^F /, ""); // a map has all landings with F, or none
  const colourOf = (name) => given.colours[bare(name)] || spare[bare(name)];

  /** Give the regions of a map colours; those that share one by chance get others. */
  function assign(regions) {
    const used = new Set(Object.values(given.colours));
    for (const name of regions.map(bare)) {
      if (given.colours[name]) continue;
      if (!spare[name] || used.has(spare[name])) {
        const free = given.more.find((colour) => !used.has(colour));
        spare[name] = free || given.more[Object.keys(spare).length % given.more.length];
      }
      used.add(spare[name]);
    }
  }

  function picture(outcomes) {
    const { count, code, regions } = outcomes;
    const canvas = html("canvas", { width: count, height: count });
    const context = canvas.getContext("2d");
    const image = context.createImageData(count, count);
    const colours = regions.map((name) => {
      const colour = colourOf(name);
      return [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
    });
    for (let at = 0; at < code.length; at++) {
      const row = count - 1 - Math.floor(at / count);
      const to = 4 * (row * count + (at % count));
      const [r, g, b] = code[at] < 0 ? [255, 255, 255] : colours[code[at]];
      image.data.set([r, g, b, 255], to);
    }
    context.putImageData(image, 0, 0);
    return canvas.toDataURL();
  }

  function drawMap(shown) {
    outcomes = shown;
    const shares = Maps.shares(shown);
    assign(shares.map(({ name }) => name));
    const [left, top] = map.at([-REACH[0], REACH[1]]);
    const [right, bottom] = map.at([REACH[0], -REACH[1]]);
    const box = {
      x: left,
      y: top,
      width: right - left,
      height: bottom - top,
      preserveAspectRatio: "none",
    };
    const image = svg("image", { ...box, href: picture(outcomes), class: "regions" });
    const lines = Maps.curve(outcomes).map(({ kind, points }) =>
      map.path(points, { class: `divide ${kind}` }),
    );
    const rooms = Maps.rooms(outcomes);
    const names = [];
    const small = [];
    for (const { code, name, share } of shares) {
      const words = name.replaceAll("-", "−");
      const place = Maps.label(outcomes, code, rooms[code], (9.5 * words.length + 8) / map.box.width);
      if (place && rooms[code].room > 0.03 * outcomes.count) {
        const fill = luminance(colourOf(name)) < 0.2 ? "#ffffff" : "#000000";
        const label = map.label(
          place,
          words,
          { class: "region-name", style: `fill: ${fill}` },
          [0, 4],
        );
        names.push(label);
      } else if (share > 0 && small.length < 12) {
        const box = svg("svg", { viewBox: "0 0 34 14", "aria-hidden": "true" });
        box.append(
          svg("rect", { x: 1, y: 1, width: 32, height: 12, fill: colourOf(name), class: "swatch" }),
        );
        small.push(html("li", {}, box, words));
      }
    }
    map.under.replaceChildren(image);
    map.layer.replaceChildren(...lines, ...names);
    byId("map-key").replaceChildren(...small);
    map.ticks("speed Ẋ", "spin Ω");
  }

  let job = 0;

  /** A coarse map at once, a fine one in slices of time between which the page stays alive. */
  function startMap() {
    const mine = ++job;
    const begin = (count) => Maps.empty(surface(), state.ydot, REACH, count);
    const coarse = begin(COARSE);
    Maps.compute(coarse, Infinity);
    Maps.divide(coarse, 1e-2, Infinity);
    drawMap(coarse);
    const fine = begin(FINE);
    document.documentElement.dataset.map = "coarse";
    const work = () => {
      if (mine !== job) return;
      if (Maps.compute(fine, 12) && Maps.divide(fine, 1e-4, 12)) {
        drawMap(fine);
        document.documentElement.dataset.map = "fine";
      } else {
        setTimeout(work, 0);
      }
    };
    setTimeout(work, 120); // not while a slider moves
  }

  // inputs -------------------------------------------------------------------------------------

  const moveHandle = Page.draggable(map, {
    name: "Landing: speed and spin",
    step: 0.05,
    get: () => [state.xdot, state.omega],
    set: ([xdot, omega]) => set({ xdot, omega }),
    say: () => `speed ${text(state.xdot)}, spin ${text(state.omega)}`,
  });
  const field = (parent, key) =>
    Page.numberInput(byId(parent), {
      id: key,
      ...RANGES[key],
      get: () => state[key],
      set: (value) => set({ [key]: value }),
    });
  const fields = [
    ...LANDING.map((key) => field("landing", key)),
    ...SURFACE.map((key) => field("surface", key)),
  ];
  const LOADS = { contact: "the surface's force", net: "that less gravity" };
  const radios = Object.entries(LOADS).map(([load, words]) => {
    const input = html("input", { type: "radio", name: "load", value: load });
    input.addEventListener("change", () => set({ load }));
    byId("loads").append(html("label", {}, input, words));
    return input;
  });
  const ball = byId("ball");
  const BALLS = [
    ["solid (2/5)", 0.4],
    ["shell (2/3)", 2 / 3],
    ["hoop or cylinder shell (1)", 1],
    ["disc or cylinder (1/2)", 0.5],
  ];
  BALLS.forEach(([words, inertia]) => ball.append(html("option", { value: inertia }, words)));
  ball.addEventListener("change", () => set({ inertia: Number(ball.value) }));
  byId("reset").addEventListener("click", () => set({ ...given.start }));

  let mapped = "";
  function draw() {
    const key = JSON.stringify([surface(), state.ydot]);
    if (key !== mapped) startMap();
    mapped = key;
    const { xdot, ydot, omega } = state;
    const shot = Bounce.simulate(surface(), { xdot, ydot, omega }, true);
    const all = curves(shot);
    if (shot.fault) {
      for (const plane of [cone, slip]) plane.layer.replaceChildren();
      slip.over.replaceChildren();
    } else {
      drawCone(all);
      drawSlip(all, shot.time);
    }
    drawWords(shot);
    coneKey(shot);
    moveHandle();
    fields.forEach((update) => update());
    for (const radio of radios) radio.checked = radio.value === state.load;
    ball.value = state.inertia;
    document.documentElement.dataset.ready = "yes";
  }

  const refresh = Page.eachFrame(draw);

  function read() {
    const asked = Page.address();
    for (const [key, { min, max }] of Object.entries(RANGES)) {
      const value = Number(asked[key]);
      if (asked[key] && Number.isFinite(value)) state[key] = Math.min(Math.max(value, min), max);
    }
    if (Object.hasOwn(LOADS, asked.load ?? "")) state.load = asked.load;
    const inertia = BALLS.map((one) => one[1]).find(
      (one) => Math.abs(one - Number(asked.inertia)) < 1e-6,
    );
    if (inertia) state.inertia = inertia;
    refresh();
  }

  byId("version").textContent = given.version;
  window.addEventListener("hashchange", read);
  read();
})();
