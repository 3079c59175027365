// The page of a system: parameters, a start, its orbit. All numbers come from Engine.
"use strict";

(async () => {
  const { svg, html, text, draggable, numberInput, address, leftOut, setAddress, eachFrame } = Page;
  const given = Page.data("explorer");
  const $ = (id) => document.getElementById(id);
  const TOLERANCE = 1e-10;
  const LIMITS = { tol: TOLERANCE, steps: 20_000, events: 5_000 };
  const SENTENCES = {
    REACHED_END: () => "reached the end",
    STOPPED: () => "stopped by a stop",
    NON_UNIQUE: (run) =>
      `the motion is not unique here${run.several.length ? `: ${run.several.join(" or ")}` : ""}`,
    ACCUMULATION: (run) =>
      `events accumulate${Number.isFinite(run.limit) ? ` at t = ${text(run.limit, 8)}` : ""}`,
    INTERSECTION: () => "no stable motion at this intersection of surfaces",
    STEP_TOO_SMALL: () => "a singularity: the steps became too short",
    NOT_FINITE: () => "a value is not finite here",
    TOO_MANY_EVENTS: () => `ended after ${text(LIMITS.events)} events`,
    TOO_MANY_STEPS: () => `ended after ${text(LIMITS.steps)} steps`,
    INCONSISTENT: () => "a constraint cannot hold here",
    ENDLESS_JUMPS: () => "jumps at one instant do not end",
  };

  let engine;
  try {
    engine = await Engine.of("own");
  } catch (error) {
    $("fault").textContent = `This browser cannot run the page: ${error.message}`;
    $("fault").hidden = false;
    throw error;
  }
  const { system } = engine;
  const { dimension } = system;

  // what is shown --------------------------------------------------------------------------------------

  const view = new Orbit.View(given.box, dimension);
  const rounded = (v) => Number(v.toPrecision(7));
  const short = (v) => String(rounded(v));
  const FLOWS = ["short", "long", "none"];
  const initial = () => ({
    p: given.sliders.map((slider) => slider.value),
    x: [...given.start],
    t: given.t_end,
    limits: view.limits.map((pair) => [...pair]),
    flow: "short",
    over: 0,
    show: 0,
    at: "in",
  });
  let state = initial();

  /** Numbers of a list in the address, if there are so many and all are finite. */
  function numbers(words, count) {
    const values = words?.split(",").map(Number) ?? [];
    return words && values.length === count && values.every(Number.isFinite) ? values : null;
  }

  function readAddress() {
    const a = address();
    const p = numbers(a.p, given.sliders.length);
    const x = numbers(a.x, dimension);
    const box = numbers(a.box, 4);
    const turn = numbers(a.turn, 2);
    const t = numbers(a.t, 1);
    const read = {
      ...{ p, x, t: t?.[0] > 0, turn: turn && !view.flat, flow: FLOWS.includes(a.flow) },
      box: box && box[0] < box[1] && box[2] < box[3],
    };
    if (p) state.p = p;
    if (x) state.x = x;
    if (read.t) [state.t] = t;
    if (read.box) state.limits = [box.slice(0, 2), box.slice(2)];
    if (read.turn) view.turn = turn;
    if (read.flow) state.flow = a.flow;
    leftOut(a, read);
  }

  let resting;
  function writeAddress() {
    clearTimeout(resting);
    const turn = view.flat ? {} : { turn: view.turn.map(short) };
    const box = state.limits.flat().map(short);
    setAddress({ p: state.p, x: state.x, t: state.t, box, ...turn, flow: state.flow });
  }

  function writeAddressAtRest() {
    clearTimeout(resting); // browsers limit how often the address may change
    resting = setTimeout(writeAddress, 200);
  }

  /** A start that runs take: discrete states have one of their values, clocks a phase below their periods. */
  function fitted(x) {
    const nearest = (v, values) =>
      values.reduce((a, b) => (Math.abs(b - v) < Math.abs(a - v) ? b : a));
    const made = x.map((v, i) => (given.values[i] ? nearest(v, given.values[i]) : v));
    for (const [i, guard] of given.clocks) {
      const at = Float64Array.from(system.n > dimension ? [...made, 0] : made);
      const late = engine.sample(at, state.p, Array(engine.width).fill(1)).at(guard);
      const period = made[i] - late;
      made[i] = Math.max(0, late < 0 ? made[i] : 0.999 * period);
    }
    return made;
  }

  // pictures -------------------------------------------------------------------------------------------

  const modes = new Pictures.Modes();
  const sizes = view.pairs.map(([low, high]) => high - low);
  const redraw = () => update();
  const portrait = new Portrait($("plane"), engine, given, modes, redraw);
  const series = new Pictures.Series($("series"), system, sizes, modes, redraw);
  const cloud = new Pictures.Cloud($("sweep"), $("cloud"), () => {
    cloud.draw();
    update();
  });
  let pieces = [];
  let moveHandle = () => {};
  const refreshers = [];

  const update = eachFrame(() => {
    state.x = fitted(state.x);
    const begun = performance.now();
    const run = engine.simulate(state.x, state.p, { ...LIMITS, tEnd: state.t });
    const took = performance.now() - begun;
    const [width, height] = state.limits.map(([a, b]) => b - a);
    const seen = (x) => view.at(x).map((v, k) => v / (k ? height : width));
    const dense = Pictures.isPhone() ? 120 : 220;
    pieces = Orbit.pieces(run, system, { seen, dense });
    const period = Orbit.period(run, system.n, dimension); // before other runs take the memory
    series.draw(pieces, Math.max(state.t, run.t));
    portrait.draw(state, view, pieces);
    facts(run, period, took);
    drawKey();
    moveHandle();
    for (const refresh of refreshers) refresh();
    writeAddressAtRest();
    sweep();
    document.body.dataset.milliseconds = (performance.now() - begun).toFixed(1);
    document.body.dataset.ready = "yes";
  });

  const minus = (words) => words.replaceAll("-", "−");

  function facts(run, period, took) {
    const words = run.itinerary.split(" ");
    const tail = words.slice(-36);
    const letters = tail.flatMap((mode) => [
      html("span", { class: modes.of(mode) }, minus(mode)),
      " ",
    ]);
    $("word").replaceChildren(...(words.length > tail.length ? ["… "] : []), ...letters);
    const rows = [
      ["status", SENTENCES[given.statuses[run.status]]?.(run) ?? `status ${run.status}`],
      ["at time", text(run.t, 8)],
      ["state", [...run.x].map((v) => text(v, 7)).join(", ")],
      ["events", `${run.events}, in ${run.steps} steps`],
      ["repeats", period ? `every ${text(period, 8)}` : "not seen"],
      ["computed in", `${took.toFixed(1)} ms`],
    ];
    const list = rows.flatMap(([name, value]) => [html("dt", {}, name), html("dd", {}, value)]);
    $("facts").replaceChildren(...list);
  }

  function drawKey() {
    const sides = {
      "+": `${given.surfaces[0]} > 0`,
      "-": `${given.surfaces[0]} < 0`,
      "*": `${given.surfaces[0]} ≠ 0`,
      s: "sliding",
    };
    const known = system.entries.length === 1 && !system.c ? sides : {};
    const shown = new Map();
    for (const { mode } of pieces) {
      const words = shown.get(modes.of(mode)) ?? new Set();
      shown.set(modes.of(mode), words.add(known[mode] ?? (minus(mode) || "smooth")));
    }
    const listed = (words) => [...words].slice(0, 3).join(", ") + (words.size > 3 ? ", …" : "");
    const names = [...shown].map(([look, words]) => [`orbit ${look}`, listed(words)]);
    for (const kind of ["attracting", "repelling"]) {
      if ($("plane").querySelector(`.band.${kind}, .cut.${kind}`)) {
        names.push([`${view.flat ? "band" : "cut"} ${kind}`, `${kind} sliding`]);
      }
    }
    for (const [side, sign] of [
      ["above", ">"],
      ["below", "<"],
    ]) {
      if ($("plane").querySelector(`.fold.${side}`)) {
        names.push([`fold ${side}`, `folds of the field where ${given.surfaces[0]} ${sign} 0`]);
      }
    }
    Pictures.key($("key"), names);
  }

  // the start, by pointer and keys; a turn in space -----------------------------------------------------

  moveHandle = draggable(portrait.plane, {
    name: "Start of the orbit",
    get steps() {
      const fine = (state.limits[0][1] - state.limits[0][0]) / 400;
      return [0, 1].map((k) => (view.flat && gaps[k]) || fine);
    },
    get: () => view.at(state.x),
    set: (point) => {
      state.x = view.moved(state.x, point).map(rounded);
      update();
    },
    say: () => system.states.map((name, k) => `${name} ${text(state.x[k])}`).join(", "),
    beside: view.flat ? null : turning(),
  });

  /** What a drag beside the start does in space: it turns the view, as arrow keys on the picture do. */
  function turning() {
    const element = $("plane");
    const turn = (yaw, pitch) => {
      view.turn = [yaw, Math.min(Math.max(pitch, -1.5), 1.5)];
      update();
    };
    element.classList.add("spin");
    element.setAttribute("tabindex", "0");
    element.setAttribute("aria-label", "View; arrow keys turn it");
    element.addEventListener("keydown", (event) => {
      const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      const way = ways[event.key];
      if (!way || event.target !== element) return;
      turn(view.turn[0] + 0.1 * way[0], view.turn[1] + 0.1 * way[1]);
      event.preventDefault();
    });
    let from = null;
    return {
      down: (event) => {
        from = [event.clientX, event.clientY, ...view.turn];
      },
      move: (event) => {
        if (from)
          turn(
            from[2] + (event.clientX - from[0]) / 150,
            from[3] + (event.clientY - from[1]) / 150,
          );
      },
      up: () => {
        from = null;
      },
    };
  }

  /** How far apart the values of a discrete state are; 0 of another state. */
  const gaps = given.values.map((values) =>
    values?.length > 1 ? Math.min(...values.slice(1).map((v, k) => Math.abs(v - values[k]))) : 0,
  );

  // inputs ---------------------------------------------------------------------------------------------

  const fine = (low, high) => Number(((high - low) / 400).toPrecision(2));
  const input = (id, name, title, [min, max], get, set, gap = 0) =>
    refreshers.push(
      numberInput($("inputs"), {
        id,
        name,
        title,
        min,
        max,
        step: gap || fine(min, max),
        get,
        set: (v) => (set(v), update()),
      }),
    );
  given.sliders.forEach(({ name, low, high }, k) => {
    input(
      `p-${k}`,
      name,
      "",
      [low, high],
      () => state.p[k],
      (v) => (state.p[k] = v),
    );
  });
  system.states.forEach((name, k) => {
    const [low, high] = view.pairs[k];
    const usual = [Math.min(low, given.start[k]), Math.max(high, given.start[k])];
    const values = given.values[k];
    input(
      `x-${k}`,
      name,
      "at the start",
      gaps[k] ? [Math.min(...values), Math.max(...values)] : usual,
      () => state.x[k],
      (v) => (state.x[k] = v),
      gaps[k],
    );
  });
  input(
    "t",
    "t",
    "at the end",
    [given.t_end / 100, 4 * given.t_end],
    () => state.t,
    (v) => (state.t = v),
  );

  // a sweep --------------------------------------------------------------------------------------------

  const isSwept = given.sliders.length > 0 && given.events;
  $("sweep-panel").hidden = !isSwept;
  const sweeper = new Sweep("own", (points) => (points ? cloud.add(points) : sweepDone()));
  const KINDS = {
    in: ["crossing", "entry", "impact", "contact", "reset"],
    out: ["exit", "release"],
  };
  const bits = (kinds) =>
    kinds.reduce((sum, kind) => sum | (1 << system.machine.kinds.indexOf(kind)), 0);

  let swept = "";
  let waiting;
  function sweep() {
    if (!isSwept) return;
    cloud.mark(state.p[state.over]);
    const others = state.p.map((v, k) => (k === state.over ? 0 : v));
    const wanted = JSON.stringify([
      others,
      state.x,
      state.over,
      state.show,
      state.at,
      cloud.plane.width,
    ]);
    if (wanted === swept) return;
    swept = wanted;
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      const { low, high, name } = given.sliders[state.over];
      cloud.begin([low, high], [name, system.states[state.show]], view.pairs[state.show]);
      sweeper.request({
        columns: Math.round(cloud.plane.box.width),
        low,
        high,
        p: state.p,
        x: state.x,
        index: state.over,
        state: state.show,
        kinds: bits(KINDS[state.at]),
        tEnd: 100 * state.t,
      });
    }, 150);
  }

  function sweepDone() {
    cloud.draw();
    const seconds = sweeper.milliseconds / 1000;
    const name = given.sliders[state.over].name;
    $("sweep-text").textContent =
      `${sweeper.runs} runs in ${text(seconds, 2)} s. Of each the first ${Sweep.SKIPPED} events are left out ` +
      `and ${Sweep.SHOWN} shown. Drag to set ${name}.`;
    document.body.dataset.swept = String(sweeper.version);
  }

  let held = false;
  const setSwept = (event) => {
    const { low, high } = given.sliders[state.over];
    const [value] = cloud.plane.underPointer(event);
    state.p[state.over] = Math.min(Math.max(rounded(value), low), high);
    update();
  };
  $("sweep").addEventListener("pointerdown", (event) => {
    held = true;
    $("sweep").setPointerCapture(event.pointerId);
    setSwept(event);
  });
  $("sweep").addEventListener("pointermove", (event) => held && setSwept(event));
  for (const end of ["pointerup", "pointercancel"]) {
    $("sweep").addEventListener(end, () => {
      held = false;
    });
  }

  function choice(id, names, key) {
    $(id).replaceChildren(...names.map((name, k) => html("option", { value: k }, name)));
    $(id).addEventListener("change", () => {
      state[key] = Number($(id).value);
      update();
    });
    refreshers.push(() => {
      $(id).value = state[key];
    });
  }
  choice(
    "sweep-p",
    given.sliders.map(({ name }) => name),
    "over",
  );
  choice("sweep-x", system.states, "show");
  $("sweep-at").addEventListener("change", () => {
    state.at = $("sweep-at").value;
    update();
  });

  /** The state that varies most at events: on a surface one of them may not. */
  function mostVaried() {
    const run = engine.simulate(state.x, state.p, { ...LIMITS, tEnd: state.t });
    const spread = system.states.map((_, i) => {
      let [low, high] = [Infinity, -Infinity];
      for (let k = 0; k < run.events; k++) {
        const value = run.eventX[k * system.n + i];
        [low, high] = [Math.min(low, value), Math.max(high, value)];
      }
      return high > low ? (high - low) / sizes[i] : 0;
    });
    return spread.indexOf(Math.max(...spread));
  }

  // buttons --------------------------------------------------------------------------------------------

  function say(words) {
    $("said").textContent = words;
    clearTimeout(say.timer);
    say.timer = setTimeout(() => {
      $("said").textContent = "";
    }, 2500);
  }

  function python() {
    const values = given.sliders
      .map(({ name }, k) => `${JSON.stringify(name)}: ${state.p[k]}`)
      .join(", ");
    const parameters = values && `, parameters={${values}}`;
    return `run = nonsmooth.simulate(system, [${state.x.join(", ")}], t_end=${state.t}${parameters})\nprint(run)\n`;
  }

  $("link").addEventListener("click", () => {
    writeAddress();
    Saving.copy(location.href, "Link").then(say);
  });
  $("python").addEventListener("click", () => Saving.copy(python(), "Python").then(say));
  $("save").addEventListener("click", () => {
    const href = URL.createObjectURL(
      new Blob([Saving.picture([portrait.plane, series.plane])], { type: "image/svg+xml" }),
    );
    html("a", { href, download: "orbit.svg" }).click();
    say("orbit.svg saved.");
  });
  $("reset").addEventListener("click", () => {
    state = { ...initial(), over: state.over, show: state.show, at: state.at };
    view.turn = new Orbit.View(given.box, dimension).turn;
    update();
  });
  const zoom = (factor) => {
    state.limits = state.limits.map(([a, b]) => {
      const middle = (a + b) / 2;
      return [middle + (a - middle) * factor, middle + (b - middle) * factor];
    });
    update();
  };
  $("in").addEventListener("click", () => zoom(1 / 1.4));
  $("out").addEventListener("click", () => zoom(1.4));
  $("flow").addEventListener("change", () => {
    state.flow = $("flow").value;
    update();
  });
  refreshers.push(() => {
    $("flow").value = state.flow;
  });
  $("flow-label").hidden = !given.flow;

  // the orbit as it runs: the whole of it in ten seconds --------------------------------------------------

  const SECONDS = 10;
  let playing = false;
  let clock = 0;
  let before = 0;
  function frame(now) {
    if (!playing) return;
    const end = pieces.at(-1).t.at(-1);
    clock = (clock + (Math.min(now - before, 100) / 1000 / SECONDS) * end) % (end || 1);
    before = now;
    const { t, x, mode } = pieces.find((piece) => clock <= piece.t.at(-1)) ?? pieces.at(-1);
    const k = Math.min(
      Math.max(
        t.findIndex((own) => own >= clock),
        1,
      ),
      t.length - 1,
    );
    const share = k ? Math.min(Math.max((clock - t[k - 1]) / (t[k] - t[k - 1] || 1), 0), 1) : 0;
    const at = k ? x[k].map((v, i) => x[k - 1][i] + share * (v - x[k - 1][i])) : x[0];
    const [cx, cy] = portrait.plane.at(view.at(at));
    const look = { cx, cy, class: `runner ${modes.of(mode)}` };
    for (const [name, value] of Object.entries(look)) portrait.runner.setAttribute(name, value);
    const [left, top] = series.plane.at([clock, 1]);
    series.cursor.setAttribute("d", `M${left} ${top}v${series.plane.box.height}`);
    requestAnimationFrame(frame);
  }
  $("play").addEventListener("click", () => {
    playing = !playing;
    $("play").textContent = playing ? "Pause" : "Play";
    $("play").setAttribute("aria-pressed", playing);
    for (const e of [portrait.runner, series.cursor])
      e.setAttribute("visibility", playing ? "visible" : "hidden");
    before = performance.now();
    requestAnimationFrame(frame);
  });

  // ----------------------------------------------------------------------------------------------------

  $("title").textContent = given.title;
  $("lead").textContent = view.flat
    ? "Drag the start or move the sliders: the orbit follows, each switch located to rounding."
    : "Drag the start, move the sliders, drag the view to turn it: the orbit follows, each switch located to rounding.";
  $("plane-title").textContent = ["", "Phase line", "Phase plane"][dimension] ?? "Orbit in space";
  $("system-card").innerHTML = given.equations;
  $("version").textContent = given.version;
  addEventListener("hashchange", () => {
    readAddress();
    update();
  });
  readAddress();
  state.show = mostVaried();
  update();
})();
