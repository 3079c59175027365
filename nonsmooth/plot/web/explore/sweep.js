// A sweep over a parameter in a worker: states at events after the transient, column by column.
"use strict";

class Sweep {
  static SKIPPED = 100; // events before the first that is shown
  static SHOWN = 40;
  static CHUNK = 16; // runs between two messages

  /** `show` is called with lists of points (value of the parameter, state) and with null at the end. */
  constructor(name, show) {
    Object.assign(this, { name, show, version: 0, milliseconds: 0, runs: 0 });
  }

  async start() {
    const texts = [...document.scripts].map((script) => script.textContent);
    const program = [texts.find((text) => text.includes("class Engine")), `(${Sweep.work})();`];
    const blob = new Blob(program, { type: "text/javascript" });
    this.worker = new Worker(URL.createObjectURL(blob));
    this.worker.onmessage = ({ data }) => {
      if (data.version !== this.version) return;
      this.show(data.points);
      if (!data.done) return;
      Object.assign(this, { milliseconds: data.milliseconds, runs: data.runs });
      this.show(null);
    };
    this.worker.postMessage(await Engine.source(this.name));
  }

  /** Begin a sweep, and end the one before. */
  async request(task) {
    const version = ++this.version;
    this.started ??= this.start();
    await this.started;
    if (version !== this.version) return;
    this.worker.postMessage({
      ...task,
      version,
      room: Sweep.SHOWN,
      skip: Sweep.SKIPPED,
      chunk: Sweep.CHUNK,
    });
  }

  /** The worker's program: columns from coarse to fine; a newer task ends an older one. */
  static work = () => {
    let engine;
    let version = 0;
    const coarseToFine = (count) => {
      const order = [];
      for (let step = 64; step >= 1; step >>= 1) {
        for (let k = 0; k < count; k += step) if (step === 64 || k % (2 * step)) order.push(k);
      }
      return order;
    };
    /** States of a column that are shown: at its events, or the last one of a run without enough of them. */
    const column = (made, k, { room, state }, d) => {
      const seen = [];
      for (let q = 0; q < room; q++) {
        if (Number.isFinite(made.sampleT[k * room + q]))
          seen.push(made.sampleX[(k * room + q) * d + state]);
      }
      return seen.length || made.status[k] ? seen : [made.x[k * d + state]];
    };
    const swept = async (task) => {
      const { system } = engine;
      const d = system.dimension;
      const begun = performance.now();
      const order = coarseToFine(task.columns);
      for (let k = 0; k < order.length; k += task.chunk) {
        await new Promise((go) => setTimeout(go, 0));
        if (version !== task.version) return;
        const values = order
          .slice(k, k + task.chunk)
          .map((c) => task.low + ((c + 0.5) / task.columns) * (task.high - task.low));
        const p = values.flatMap((v) => task.p.map((own, j) => (j === task.index ? v : own)));
        const x = values.flatMap(() => (system.n > d ? [...task.x, 0] : task.x));
        const hits = { hit_kinds: task.kinds, hit_skip: task.skip, hit_count: task.room };
        const limits = { tEnd: task.tEnd, tol: 1e-7, steps: 4000, events: 2000 };
        const made = engine.many(
          Float64Array.from(x),
          Float64Array.from(p),
          { ...limits, hits },
          task.room,
        );
        const points = values.flatMap((v, c) => column(made, c, task, d).flatMap((y) => [v, y]));
        const done = k + task.chunk >= order.length;
        const milliseconds = performance.now() - begun;
        postMessage({ version, points, done, milliseconds, runs: order.length });
      }
    };
    onmessage = async ({ data }) => {
      if (data.bytes) {
        engine = Engine.load(data.bytes, data.system);
        return;
      }
      version = data.version;
      engine = await engine;
      await swept(data);
    };
  };
}
