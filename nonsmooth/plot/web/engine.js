// The library's driver in a page: C compiled to WebAssembly, and a system as an image of its instructions.
"use strict";

class Engine {
  /** Compile the module (bytes) for a system that plot/driver.py has described. */
  static async load(bytes, system) {
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Engine(instance.exports, system);
  }

  constructor(c, system) {
    Object.assign(this, { c, system, machine: system.machine });
    c._initialize();
    this.width = system.m + system.c;
    this.parameters = system.parameters.length + system.cells + 1; // with room for cells of tables
    this.row = system.n + 2 * this.width + system.atoms; // numbers of a state that is sampled
    this.image = this.loadImage(system);
    for (const name of ["Options", "Batch", "Output"]) {
      this[name] = c.calloc(1, this.machine.layout[name].size);
    }
    this.named = c.calloc(this.machine.guards * system.named, 1);
    this.input = c.malloc(8 * (system.n + this.parameters + 1));
    this.letters = c.malloc(this.width + 1);
    this.read = c.malloc(8 * (4 + 15) + 4 * (this.width + 1 + 16) + 8 * (16 * system.n + 1));
    this.rooms = null;
    this.refresh();
  }

  // Views end when the module's memory grows, so they are made anew.
  f64(at, count) {
    return new Float64Array(this.c.memory.buffer, at, count);
  }
  i32(at, count) {
    return new Int32Array(this.c.memory.buffer, at, count);
  }
  i64(at, count) {
    return new BigInt64Array(this.c.memory.buffer, at, count);
  }

  /** Copy the image of a system into the memory, with the addresses that it has there. */
  loadImage({ image, addresses }) {
    const at = this.c.malloc(image.length + 8);
    new Uint8Array(this.c.memory.buffer, at, image.length).set(image);
    const words = new DataView(this.c.memory.buffer, at);
    for (const offset of addresses) words.setUint32(offset, words.getUint32(offset, true) + at, true);
    return at;
  }

  /** Begin a new table of modes and itineraries: they grow with every run. */
  refresh() {
    if (this.run) {
      this.c.run_free(this.run);
      this.c.table_free(this.table);
    }
    this.table = this.c.table_new(this.system.mode_width);
    this.run = this.c.run_new(this.image, this.table);
    if (!this.run) throw new Error("no memory for a run of this system");
    this.modes = [];
    this.parents = [];
  }

  refreshIfLarge() {
    if (this.c.table_size(this.table) > 20000) this.refresh();
  }

  /** Write fields of a structure. */
  write(name, values) {
    const { fields } = this.machine.layout[name];
    const view = new DataView(this.c.memory.buffer, this[name]);
    for (const [key, value] of Object.entries(values)) {
      const [at, kind] = fields[key];
      if (kind === "d") view.setFloat64(at, value, true);
      else if (kind === "P") view.setUint32(at, value, true);
      else if (kind === "i") view.setInt32(at, value, true);
      else view.setBigInt64(at, BigInt(value), true);
    }
  }

  writeOptions(
    { tEnd, tol, maxStep = Infinity, steps = 1_000_000, events = 100_000, hits = {} },
    dense,
  ) {
    const none = { hit_kinds: 0, hit_side: 0, hit_skip: 0, hit_count: 0 };
    const limits = { max_steps: steps, max_events: events, max_jumps: 1000 };
    this.write("Options", {
      ...{ t_end: tEnd, rtol: tol, atol: tol, max_step: maxStep, rest_below: 0, ...limits },
      ...{ at_kind: -1, at_count: 0, dense: +dense, hit_after: 0, method: 0 },
      ...{
        hit_every: 1,
        hit_width: this.system.named,
        hit_named: this.named,
        passed: 0,
        ...none,
        ...hits,
      },
    });
  }

  /** Make arrays for the output of a run; larger ones take over what was written. */
  makeRoom(rooms, counts) {
    const { n, order, motion } = this.system;
    const { arrays } = this.machine;
    const length = { coefficients: n * (order + 1), point_x: n, event_x: n, event_after_x: n };
    const old = this.arrays ?? {};
    this.arrays = {};
    for (const [name, [size, what]] of Object.entries(arrays)) {
      const kind = ["step", "point", "event"].indexOf(what);
      const row = size * (name === "event_motion" ? motion : (length[name] ?? 1));
      const at = (this.arrays[name] = this.c.malloc(row * rooms[kind] + 8));
      if (!at) throw new Error("no memory for so long a run");
      const from = old[name];
      if (counts)
        new Uint8Array(this.c.memory.buffer).copyWithin(at, from, from + row * counts[kind]);
      if (from) this.c.free(from);
    }
    this.rooms = rooms;
    const [step_room, point_room, event_room] = rooms;
    this.write("Output", { ...this.arrays, step_room, point_room, event_room });
  }

  count(counts) {
    this.write("Output", { steps: counts[0], points: counts[1], events: counts[2] });
  }

  /** Start and parameters in the memory; a system that depends on time has it as its last state. */
  given(x, p, t) {
    const { n, dimension } = this.system;
    const at = this.f64(this.input, n + this.parameters);
    at.fill(0);
    at.set(n > dimension ? [...x, t] : x);
    at.set(p, n);
    return [this.input, this.input + 8 * n];
  }

  /** Write the letters of a mode in which a run starts; 0 for none. */
  startMode(mode) {
    if (!mode) return 0;
    const signs = Array.from(mode, (letter) => ({ "+": 1, o: 1, "-": -1 })[letter] ?? 0);
    new Int8Array(this.c.memory.buffer, this.letters, this.width).set(signs);
    return this.letters;
  }

  /** One run with its polynomials: views of the memory that hold until the next run. */
  simulate(x, p, options) {
    const { c } = this;
    const t = options.tStart ?? 0;
    this.refreshIfLarge();
    if (!this.rooms) this.makeRoom([256, 512, 256]);
    this.count([0, 0, 0]);
    this.writeOptions(options, true);
    const mode = this.startMode(options.startMode);
    c.run_begin(this.run, this.Options, this.Output, ...this.given(x, p, t), mode, t, 0);
    for (;;) {
      const status = c.run_continue(this.run, 1n << 40n);
      const counts = this.readCounts();
      if (status !== this.machine.full) return this.result(counts);
      const written = counts.slice(7, 10);
      this.makeRoom(
        this.rooms.map((room, k) => (written[k] + 8 > room / 2 ? 2 * room : room)),
        written,
      );
      this.count(written);
      c.run_resume(this.run, this.Output);
    }
  }

  readCounts() {
    const numbers = this.read;
    const counts = numbers + 32;
    const active = counts + 8 * 15;
    const several = active + 4 * (this.width + 1);
    const rates = (several + 4 * 16 + 7) & ~7;
    this.c.run_read(this.run, numbers, counts, active, several, rates);
    const found = Array.from(this.i64(counts, 15), Number);
    this.several = Array.from(this.i32(several, found[11]));
    return found;
  }

  result(counts) {
    const [steps, points, events] = counts.slice(7, 10);
    const { n, order, dimension } = this.system;
    this.readTable(); // before the views: the memory may grow
    const a = this.arrays;
    const [t, limit] = this.f64(this.read, 2);
    return {
      status: counts[0],
      reason: counts[1],
      where: counts[2],
      itinerary: this.wordOf(steps, counts[3]),
      several: this.several.map((mode) => this.modes[mode]),
      steps,
      events,
      t,
      limit,
      starts: this.f64(a.start, steps),
      coefficients: this.f64(a.coefficients, steps * n * (order + 1)),
      stepModes: Array.from(this.stepModes(steps), (mode) => this.modes[mode]),
      x: this.f64(a.point_x, points * n).slice((points - 1) * n, (points - 1) * n + dimension),
      eventT: this.f64(a.event_t, events),
      eventX: this.f64(a.event_x, events * n),
      eventAfterX: this.f64(a.event_after_x, events * n),
      eventKind: this.i32(a.event_kind, events),
    };
  }

  /** Numbers of the modes of the steps. */
  stepModes(steps) {
    return this.i32(this.arrays.step_mode, steps).map((mode) => mode & ~this.machine.implicit);
  }

  /** Modes of a run in order; of one without a step its one mode. */
  wordOf(steps, mode) {
    const numbers = this.stepModes(steps);
    const word = [...numbers].filter((own, k) => k === 0 || own !== numbers[k - 1]);
    return (word.length ? word : [mode]).map((own) => this.modes[own] || "o").join(" ");
  }

  /** Read modes and the tree of itineraries, if there are new ones. */
  readTable() {
    const { c } = this;
    const count = c.table_modes(this.table);
    const size = c.table_size(this.table);
    if (count === this.modes.length && size === this.parents.length) return;
    const wide = this.system.mode_width;
    const at = c.malloc(8 * size + count * wide + 8);
    c.table_read(this.table, at, at + 4 * size, at + 8 * size);
    const bytes = new Uint8Array(c.memory.buffer, at + 8 * size, count * wide).slice();
    this.modes = Array.from({ length: count }, (_, k) =>
      this.spelled(bytes.subarray(k * wide, (k + 1) * wide)),
    );
    this.parents = this.i32(at, size).slice();
    this.nodeModes = this.i32(at + 4 * size, size).slice();
    c.free(at);
  }

  /** A mode as itineraries show it: a letter for each surface, set, breakpoint and contact, then discrete states. */
  spelled(bytes) {
    const { m, entries, half_lines: halfLines, discrete, tables } = this.system;
    const signs = new Int8Array(bytes.buffer, bytes.byteOffset, this.width);
    const values = new Float64Array(bytes.slice(this.width).buffer);
    const letters = (i) => {
      const k = tables.findIndex(({ element }) => element === i);
      if (k < 0) return halfLines.includes(i) ? "co"[+!!signs[i]] : "-s+****i"[signs[i] + 1];
      const { count, below } = tables[k];
      const above = below[Math.max(values[discrete.length + k], 0)];
      return "+".repeat(above) + "-".repeat(count - above);
    };
    const surfaces = entries.map(letters);
    const contacts = Array.from(signs.subarray(m), (sign) => "co"[+!!sign]);
    const labels = discrete.map((name, k) => `${name}=${Engine.general(values[k])}`);
    return [[...surfaces, ...contacts].join(""), ...labels].filter((part) => part).join(",");
  }

  /** The modes of an itinerary, which is a node of the tree. */
  word(node) {
    const word = [];
    for (; node > 0; node = this.parents[node]) word.push(this.modes[this.nodeModes[node]] || "o");
    return word.reverse().join(" ");
  }

  /** Reserve arrays of so many bytes each; `free` gives all back. */
  reserve(sizes) {
    const base = this.c.malloc(sizes.reduce((sum, size) => sum + size + 16, 16));
    if (!base) throw new Error("no memory for so many runs");
    let next = base;
    const addresses = sizes.map((size) => {
      const at = (next + 7) & ~7;
      next = at + size + 8;
      return at;
    });
    return { addresses, free: () => this.c.free(base) };
  }

  /**
   * Many runs, from starts (count, n) with parameters (count, parameters): their ends, and of each run the
   * states at `room` events of the kinds `options.hits.hit_kinds`.
   */
  many(x0, p, options, room = 0) {
    const { c } = this;
    const { n, dimension: d } = this.system;
    const own = this.system.parameters.length;
    const count = x0.length / n;
    const stride = this.parameters;
    this.refreshIfLarge();
    const kindCount = this.machine.kinds.length;
    const words = [n, stride, d, 1, 1, 1, kindCount, room, room * d].map((k) => 8 * k * count);
    const { addresses, free } = this.reserve([...words, 16, 8]);
    const [starts, values, ends, t, status, itinerary, kinds, sampleT, sampleX, totals, next] =
      addresses;
    this.f64(starts, x0.length).set(x0);
    const table = this.f64(values, stride * count).fill(0);
    for (let k = 0; k < count; k++) table.set(p.subarray(k * own, (k + 1) * own), k * stride);
    this.f64(sampleT, room * count).fill(NaN);
    this.i64(totals, 2).fill(0n);
    this.i64(next, 1).fill(0n);
    this.write("Batch", {
      ...{
        count,
        p_stride: stride,
        t0: options.tStart ?? 0,
        x0: starts,
        p: values,
        x: ends,
        t,
      },
      ...{ status, itinerary, kinds, at_x: 0, at_t: 0, totals, room, times_stride: 0, times: 0 },
      ...{ sample_t: sampleT, sample_x: sampleX, kinds_width: kindCount },
    });
    new Uint8Array(c.memory.buffer, this.named, this.machine.guards * this.system.named).fill(
      +(room > 0),
    );
    this.writeOptions(options, false);
    while (c.run_many(this.run, next, this.Batch, this.Options, 0, 1n << 40n));
    this.readTable();
    const made = {
      x: this.f64(ends, d * count).slice(),
      t: this.f64(t, count).slice(),
      status: new Int8Array(c.memory.buffer, status, count).slice(),
      itinerary: Array.from(this.i32(itinerary, count), (node) => this.word(node)),
      sampleT: this.f64(sampleT, room * count).slice(),
      sampleX: this.f64(sampleX, room * count * d).slice(),
    };
    free();
    return made;
  }

  /** Rates of states; rates of surfaces; their functions; those of stops and resets: rows for states (count, n). */
  sample(points, p, multipliers) {
    const { n } = this.system;
    const count = points.length / n;
    const { row, parameters } = this;
    const sizes = [points.length, parameters, this.width, row * count].map((k) => 8 * k);
    const { addresses, free } = this.reserve(sizes);
    const [at, values, held, out] = addresses;
    this.f64(at, points.length).set(points);
    this.f64(values, parameters).fill(0).set(p);
    this.f64(held, this.width).fill(0).set(multipliers);
    this.c.run_sample(this.run, values, at, BigInt(count), held, out);
    const made = this.f64(out, row * count).slice();
    free();
    return made;
  }
}

/** A number with six digits at most, as Python's format "g" writes it: a tie goes to the even digit. */
Engine.general = (value) => {
  const [, even] = value.toExponential(99).match(/^(.*[02468])50*e/) ?? [];
  const isTie = even?.replace(/\D/g, "").length === 6;
  const [rounded, power] = value.toExponential(5).split("e");
  const digits = String(Number(isTie ? even : rounded));
  if (value === 0 || (power >= -4 && power < 6)) return String(Number(`${digits}e${power}`));
  return `${digits}e${power[0]}${power.slice(1).padStart(2, "0")}`;
};

/** States and rates of a step of a run at a time since its start. */
Engine.onStep = (run, { n, order, dimension }, step, s) => {
  const stride = order + 1;
  const x = new Array(dimension);
  const rates = new Array(dimension);
  for (let i = 0; i < dimension; i++) {
    const first = (step * n + i) * stride;
    let [value, slope] = [0, 0];
    for (let k = first + order; k >= first; k--) {
      slope = slope * s + value;
      value = value * s + run.coefficients[k];
    }
    [x[i], rates[i]] = [value, slope];
  }
  return { x, rates };
};

/** Bytes of a text in base 64, inflated. */
Engine.inflated = async (text) => {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

/** What a worker needs for the system of a name that the page holds; the module is inflated once. */
Engine.source = async (name) => {
  Engine.module ??= Engine.inflated(Page.data("module"));
  const system = Page.data(`system-${name}`);
  system.image = await Engine.inflated(system.image);
  return { bytes: await Engine.module, system };
};

/** The engine with the system of a name that the page holds. */
Engine.of = async (name) => {
  const { bytes, system } = await Engine.source(name);
  return Engine.load(bytes, system);
};

if (typeof module !== "undefined") module.exports = { Engine };
