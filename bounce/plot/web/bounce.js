// The explorer of one bounce: one state (surface, landing), and the pictures that follow it.
"use strict";

(async () => {
  const { svg, html, text } = Page;
  const given = Page.data("bounce");
  const byId = (id) => document.getElementById(id);
  const REACH = given.reach; // of the map, in xdot and omega
  const FINE = 160;
  const COARSE = 30;
  const SECONDS = 5; // in which the ball plays a bounce
  const state = { ...given.start };

  let contacts;
  try {
    const loaded = given.loads.map(async (load) => [load, await Contact.of(load, given)]);
    contacts = Object.fromEntries(await Promise.all(loaded));
  } catch (error) {
    byId("fault").textContent = `This browser cannot run the page: ${error.message}`;
    byId("fault").hidden = false;
    throw error;
  }
  const contact = () => contacts[state.load];

  const fine = (size) => Number((10 ** Math.floor(Math.log10(size / 150))).toPrecision(1));
  const range = (name, title, [min, max]) => ({ name, title, min, max, step: fine(max - min) });
  const LANDING = {
    xdot: range("Ẋ", "speed along the ground", [-REACH[0], REACH[0]]),
    omega: range("Ω", "spin, positive for backspin", [-REACH[1], REACH[1]]),
    ydot: range("Ẏ", "normal speed, downward", [Math.min(-3, 2 * state.ydot), -0.1]),
  };
  LANDING.xdot.step = LANDING.omega.step = LANDING.ydot.step = 0.01;
  const SURFACE = Object.fromEntries(
    given.sliders.map(({ name, symbol, words, low, high }) => [
      name,
      range(symbol, words, [low, high]),
    ]),
  );
  const RANGES = { ...LANDING, ...SURFACE };
  const VERBS = {
    "+": "slips forward",
    "-": "slips in reverse",
    s: "rolls",
    F: "feels no friction at first",
  };

  const surface = () => Object.fromEntries(given.parameters.map((name) => [name, state[name]]));
  const colours = new Pictures.Colours(given);
  let outcomes = null; // the map that is shown
  const drawMap = (shown) => {
    outcomes = shown;
    Pictures.drawMap(map, byId("map-key"), shown, colours);
  };
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
  const ballPicture = new Pictures.Ball(byId("ball-picture"));
  const movers = [cone, slip].map((plane) => {
    const dot = svg("circle", { r: 6, class: "mover", visibility: "hidden" });
    plane.element.append(dot);
    return { plane, dot };
  });

  function set(changes) {
    Object.assign(state, changes);
    const shown = Object.entries(state).map(([k, v]) => [
      k,
      typeof v === "number" ? Number(v.toPrecision(8)) : v,
    ]);
    Page.setAddress(Object.fromEntries(shown));
    refresh();
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
    byId("verdict").textContent = regionName(itinerary).replaceAll("-", "−");
    byId("story").textContent =
      `The ball ${listed(itinerary.split(" ").map((m) => VERBS[m] ?? "slips"))}, and leaves ${
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
      .map((phase) => `${VERBS[phase.mode] ?? "slips"} from t = ${text(phase.start)}`);
    byId("slip-text").textContent =
      `It lands with slip ${text(state.xdot + state.omega)}; ${[...turns, `lift-off at t = ${text(time)}`].join("; ")}.`;
    byId("cone-text").textContent =
      "In slip the friction lies on an edge of the cone, in rolling inside it. Dot: touch-down; " +
      "squares: changes; diamond: lift-off. Along a thin line friction jumps.";
  }

  function coneKey(shot) {
    const modes = [...new Set(shot.phases.map((phase) => phase.mode))];
    const items = modes.map((mode) => {
      const line = svg("path", {
        d: "M1 7H33",
        class: `phase phase-${Pictures.nameOf(mode)}`,
        fill: "none",
      });
      return html(
        "li",
        {},
        svg("svg", { viewBox: "0 0 34 14", "aria-hidden": "true" }, line),
        VERBS[mode] ?? "slips",
      );
    });
    byId("cone-key").replaceChildren(...items);
  }

  // the map ------------------------------------------------------------------------------------

  let job = 0;

  /** A coarse map at once, a fine one in slices of time between which the page stays alive. */
  function startMap() {
    const mine = ++job;
    const begin = (count) => Maps.empty(contact(), surface(), state.ydot, REACH, count);
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

  // the ball as it goes ------------------------------------------------------------------------

  /** The course of the bounce that is shown: the ball at a time, and its points in the other pictures. */
  const course = {
    points: [],
    clock: 0,
    playing: false,

    take(all) {
      let angle = 0;
      this.points = all.flatMap(({ mode, points }) =>
        points.map((p, k) => {
          if (k) angle += 0.5 * (p.omega + points[k - 1].omega) * (p.t - points[k - 1].t);
          return { ...p, mode, angle };
        }),
      );
      const xs = this.points.map((p) => p.x);
      this.reach = [Math.min(...xs), Math.max(...xs)];
      this.most = Math.max(...this.points.map((p) => Math.abs(p.friction)));
      this.draw();
    },

    get end() {
      return this.points.at(-1)?.t ?? 0;
    },

    /** The point at the clock, between those that were computed. */
    get now() {
      const { points } = this;
      const t = this.clock * this.end;
      const k = points.findIndex((p) => p.t > t);
      if (k < 1) return k < 0 ? points.at(-1) : points[0];
      const [a, b] = [points[k - 1], points[k]];
      const s = (t - a.t) / (b.t - a.t || 1);
      const between = (name) => a[name] + s * (b[name] - a[name]);
      const names = ["t", "x", "y", "angle", "load", "friction", "slip"];
      return { mode: a.mode, ...Object.fromEntries(names.map((name) => [name, between(name)])) };
    },

    draw() {
      const isShown = this.points.length > 0;
      byId("ball-panel").hidden = !isShown;
      for (const { dot } of movers) dot.setAttribute("visibility", isShown ? "visible" : "hidden");
      if (!isShown) return;
      const p = this.now;
      const [inCone, inSlip] = [cone.at([p.friction, p.load]), slip.at([p.t, p.slip])];
      [inCone, inSlip].forEach(([cx, cy], k) => {
        movers[k].dot.setAttribute("cx", cx);
        movers[k].dot.setAttribute("cy", cy);
      });
      ballPicture.draw(p, this.reach, p.mode, this.most);
      byId("clock").value = this.clock;
      byId("clock").setAttribute(
        "aria-valuetext",
        `time ${text(p.t, 3)}: ${VERBS[p.mode] ?? "slips"}`,
      );
    },

    frame(before) {
      if (!this.playing) return;
      requestAnimationFrame((now) => {
        this.clock = (this.clock + Math.min(now - before, 100) / 1000 / SECONDS) % 1;
        this.draw();
        this.frame(now);
      });
    },
  };
  byId("play").addEventListener("click", () => {
    course.playing = !course.playing;
    byId("play").textContent = course.playing ? "Pause" : "Play";
    byId("play").setAttribute("aria-pressed", course.playing);
    course.frame(performance.now());
  });
  byId("clock").addEventListener("input", () => {
    course.clock = Number(byId("clock").value);
    course.draw();
  });

  // inputs -------------------------------------------------------------------------------------

  const moveHandle = Page.draggable(map, {
    name: "Landing: speed and spin",
    steps: [0.05, 0.05],
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
    ...["xdot", "omega", "ydot"].map((key) => field("landing", key)),
    ...given.sliders.map(({ name }) => field("surface", name)),
  ];
  const LOADS = { contact: "the surface's force", net: "that less gravity" };
  byId("load-choice").hidden = given.loads.length < 2;
  const radios = given.loads.map((load) => {
    const input = html("input", { type: "radio", name: "load", value: load });
    input.addEventListener("change", () => set({ load }));
    byId("loads").append(html("label", {}, input, LOADS[load]));
    return input;
  });
  const ball = byId("ball");
  const BALLS = [
    ["solid (2/5)", 0.4],
    ["shell (2/3)", 2 / 3],
    ["hoop or cylinder shell (1)", 1],
    ["disc or cylinder (1/2)", 0.5],
  ];
  if (!BALLS.some((one) => one[1] === given.start.inertia)) {
    BALLS.unshift([`this one (${text(given.start.inertia)})`, given.start.inertia]);
  }
  BALLS.forEach(([words, inertia]) => ball.append(html("option", { value: inertia }, words)));
  ball.addEventListener("change", () => set({ inertia: Number(ball.value) }));
  byId("reset").addEventListener("click", () => set({ ...given.start }));

  let mapped = "";
  function draw() {
    const key = JSON.stringify([surface(), state.load, state.ydot]);
    if (key !== mapped) startMap();
    mapped = key;
    const { xdot, ydot, omega } = state;
    const shot = contact().simulate(surface(), { xdot, ydot, omega }, true);
    const all = shot.phases.filter((phase) => phase.points.length);
    if (shot.fault) {
      for (const plane of [cone, slip]) plane.layer.replaceChildren();
      slip.over.replaceChildren();
    } else {
      Pictures.drawCone(cone, all, state.mu);
      Pictures.drawSlip(slip, all, shot.time);
    }
    course.take(all);
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
    const read = {};
    for (const [key, { min, max }] of Object.entries(RANGES)) {
      const value = Number(asked[key]);
      read[key] = asked[key] && Number.isFinite(value);
      if (read[key]) state[key] = Math.min(Math.max(value, min), max);
    }
    read.load = given.loads.includes(asked.load);
    if (read.load) state.load = asked.load;
    const inertia = BALLS.map((one) => one[1]).find(
      (one) => Math.abs(one - Number(asked.inertia)) < 1e-6,
    );
    if (inertia) state.inertia = inertia;
    Page.leftOut(asked, { ...read, inertia });
    refresh();
  }

  byId("title").textContent = given.title;
  byId("model").textContent =
    given.model === "KelvinVoigt"
      ? "The linear (Kelvin-Voigt) contact of Biber, Champneys and Szalai (2022)"
      : `The contact model ${given.model}`;
  byId("version").textContent = given.version;
  window.addEventListener("hashchange", read);
  read();
})();
