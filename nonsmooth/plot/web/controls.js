// What the explorers share: numbers as text, SVG, planes with axes, draggable points, linked inputs.
"use strict";

const Page = (() => {
  const NAMESPACE = "http://www.w3.org/2000/svg";

  /** A number as text, with a minus sign and an infinity that screen readers say. */
  function text(value, digits = 4) {
    if (Number.isNaN(value)) return "undecided";
    if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
    if (value === 0) return "0";
    const rounded = Number(value.toPrecision(digits));
    const words =
      Math.abs(rounded) < 1e6 ? String(rounded) : rounded.toExponential().replace("+", "");
    return words.replaceAll("-", "−");
  }

  /** An element of SVG with attributes and children. */
  function svg(tag, attributes = {}, ...children) {
    const element = document.createElementNS(NAMESPACE, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  }

  /** An element of HTML with attributes and children. */
  function html(tag, attributes = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  }

  let clips = 0;

  /**
   * A frame in an SVG element with linear axes; what is drawn in `under` and `layer` is clipped to it.
   * Its unit is a pixel of the page at every width, so that words have one size; `redraw` is called
   * when the width has changed.
   */
  class Plane {
    constructor(element, { x, y, aspect = 1, margin = [14, 14, 46, 56], redraw = () => {} }) {
      this.element = element;
      this.aspect = aspect;
      this.margin = margin;
      const id = `clip-${++clips}`;
      this.hole = svg("rect");
      this.frame = svg("rect", { class: "frame" });
      this.under = svg("g", { "clip-path": `url(#${id})` });
      this.layer = svg("g", { "clip-path": `url(#${id})` });
      this.axes = svg("g", { class: "axes" });
      this.over = svg("g");
      const clip = svg("clipPath", { id }, this.hole);
      element.replaceChildren(clip, this.under, this.layer, this.frame, this.axes, this.over);
      this.limits(x, y);
      this.fit();
      new ResizeObserver(() => {
        if (Math.abs(element.clientWidth - this.width) > 1) {
          this.fit();
          redraw();
        }
      }).observe(element);
    }

    /** Take the width that the element has. */
    fit() {
      this.width = Math.max(this.element.clientWidth, 200);
      this.height = Math.round(this.aspect * this.width);
      this.element.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
      const [top, right, bottom, left] = this.margin;
      const [width, height] = [this.width - left - right, this.height - top - bottom];
      this.box = { left, top, width, height };
      for (const rect of [this.hole, this.frame]) {
        for (const [name, value] of Object.entries({ x: left, y: top, width, height })) {
          rect.setAttribute(name, value);
        }
      }
    }

    /** Set the ranges of both axes. */
    limits(x, y) {
      [this.x, this.y] = [x, y];
    }

    /** Pixel of a point. */
    at([u, v]) {
      const { left, top, width, height } = this.box;
      const [a, b] = this.x;
      const [c, d] = this.y;
      return [left + ((u - a) / (b - a)) * width, top + height - ((v - c) / (d - c)) * height];
    }

    /** Point of a pixel of the viewBox. */
    from([px, py]) {
      const { left, top, width, height } = this.box;
      const [a, b] = this.x;
      const [c, d] = this.y;
      return [a + ((px - left) / width) * (b - a), c + ((top + height - py) / height) * (d - c)];
    }

    /** Path of a polyline. */
    path(points, attributes = {}) {
      const d = points.map((p, k) => {
        const [a, b] = this.at(p);
        return `${k ? "L" : "M"}${a.toFixed(2)} ${b.toFixed(2)}`;
      });
      return svg("path", { d: d.join(""), fill: "none", ...attributes });
    }

    /** Closed polygon. */
    polygon(points, attributes = {}) {
      const path = this.path(points, attributes);
      path.setAttribute("d", path.getAttribute("d") + "Z");
      if (!("fill" in attributes)) path.removeAttribute("fill");
      return path;
    }

    /** Text centred on a point, moved by pixels. */
    label(point, words, attributes = {}, [dx, dy] = [0, 0]) {
      const [x, y] = this.at(point);
      const place = { x: (x + dx).toFixed(2), y: (y + dy).toFixed(2) };
      return svg("text", { ...place, "text-anchor": "middle", ...attributes }, words);
    }

    /** Arrowhead on a polyline at a fraction of its length on the screen. */
    arrow(points, fraction, attributes = {}, size = 5.5) {
      const pixels = points.map((p) => this.at(p));
      const steps = pixels
        .slice(1)
        .map((p, k) => Math.hypot(p[0] - pixels[k][0], p[1] - pixels[k][1]));
      let left = fraction * steps.reduce((a, b) => a + b, 0);
      let k = 0;
      while (k < steps.length - 1 && left > steps[k]) left -= steps[k++];
      if (!(steps[k] > 0)) return svg("g");
      const [dx, dy] = [0, 1].map((i) => (pixels[k + 1][i] - pixels[k][i]) / steps[k]);
      const tip = [
        pixels[k][0] + left * dx + 0.6 * size * dx,
        pixels[k][1] + left * dy + 0.6 * size * dy,
      ];
      const back = [tip[0] - 1.9 * size * dx, tip[1] - 1.9 * size * dy];
      const corners = [
        tip,
        [back[0] - 0.62 * size * dy, back[1] + 0.62 * size * dx],
        [back[0] + 0.62 * size * dy, back[1] - 0.62 * size * dx],
      ];
      const d = corners.map((c) => c.map((v) => v.toFixed(2)).join(",")).join(" ");
      return svg("polygon", { points: d, ...attributes });
    }

    /** Draw ticks and names of the axes. */
    ticks(xName, yName) {
      const { left, top, width, height } = this.box;
      const parts = [];
      for (const v of steps(this.x, width / 60)) {
        const [px] = this.at([v, this.y[0]]);
        parts.push(svg("path", { d: `M${px} ${top + height}v-5`, class: "tick" }));
        parts.push(svg("text", { x: px, y: top + height + 17, "text-anchor": "middle" }, text(v)));
      }
      for (const v of steps(this.y, height / 60)) {
        const [, py] = this.at([this.x[0], v]);
        parts.push(svg("path", { d: `M${left} ${py}h5`, class: "tick" }));
        parts.push(svg("text", { x: left - 7, y: py + 4, "text-anchor": "end" }, text(v)));
      }
      const middle = { "text-anchor": "middle", class: "axis-name" };
      parts.push(svg("text", { x: left + width / 2, y: this.height - 8, ...middle }, xName));
      const turn = `translate(15 ${top + height / 2}) rotate(-90)`;
      parts.push(svg("text", { transform: turn, ...middle }, yName));
      this.axes.replaceChildren(...parts);
    }

    /** Point under a pointer event. */
    underPointer(event) {
      const seen = this.element.getBoundingClientRect();
      const [a, b] = [event.clientX - seen.left, event.clientY - seen.top];
      return this.from([(a * this.width) / seen.width, (b * this.height) / seen.height]);
    }
  }

  /** Round values of an axis, about `count` of them. */
  function steps([low, high], count) {
    const rough = (high - low) / Math.max(count, 1);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].find((s) => s * power >= rough) * power;
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
      found.push(Math.abs(k * step) < 1e-12 ? 0 : Number((k * step).toPrecision(12)));
    }
    return found;
  }

  const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

  /**
   * A point of a plane that is moved by pointer and by arrow keys (with Shift ten times as far). A pointer elsewhere
   * in the plane moves it there, or does what `beside` says: functions `down`, `move` and `up`.
   */
  function draggable(plane, given) {
    const { name, get, set, say, beside } = given;
    const handle = svg(
      "g",
      { class: "handle", tabindex: 0, role: "slider", "aria-label": name },
      svg("circle", { r: 22, class: "grip" }),
      svg("circle", { r: 7.5, class: "dot" }),
    );
    plane.over.append(handle);
    const clamp = ([u, v]) => [
      Math.min(Math.max(u, plane.x[0]), plane.x[1]),
      Math.min(Math.max(v, plane.y[0]), plane.y[1]),
    ];
    let held = false;
    if (!beside) plane.element.classList.add("draggable");
    plane.element.addEventListener("pointerdown", (event) => {
      const isOutside = !handle.contains(event.target);
      if (beside && isOutside && !event.button) {
        beside.down(event);
        plane.element.setPointerCapture(event.pointerId);
      }
      // a finger beside the point scrolls the page; a tap, which is a click, moves the point there
      if (event.button || (isOutside && (beside || event.pointerType === "touch"))) return;
      held = true;
      plane.element.setPointerCapture(event.pointerId);
      set(clamp(plane.underPointer(event)));
      handle.focus({ preventScroll: true });
      event.preventDefault();
    });
    plane.element.addEventListener("pointermove", (event) => {
      if (held) set(clamp(plane.underPointer(event)));
      else beside?.move(event);
    });
    // touch-action is not heeded inside SVG everywhere: a finger on the point must not scroll
    handle.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
    plane.element.addEventListener("click", (event) => {
      if (!beside && !handle.contains(event.target)) set(clamp(plane.underPointer(event)));
    });
    for (const end of ["pointerup", "pointercancel"]) {
      plane.element.addEventListener(end, (event) => {
        held = false;
        beside?.up(event);
      });
    }
    handle.addEventListener("keydown", (event) => {
      const move = ARROWS[event.key];
      if (!move) return;
      const { steps } = given; // which may follow the plane's ranges
      const far = event.shiftKey ? 10 : 1;
      // the coordinate that moves to multiples of the step, so that steps back and forth cancel
      const moved = (v, k) => Math.round(v / steps[k] + far * move[k]) * steps[k];
      set(clamp(get().map((v, k) => (move[k] ? moved(v, k) : v))));
      event.preventDefault();
    });
    return () => {
      const [x, y] = plane.at(clamp(get()));
      handle.setAttribute("transform", `translate(${x.toFixed(2)} ${y.toFixed(2)})`);
      const values = { valuenow: get()[0], valuemin: plane.x[0], valuemax: plane.x[1] };
      for (const [key, value] of Object.entries(values)) handle.setAttribute(`aria-${key}`, value);
      handle.setAttribute("aria-valuetext", say());
    };
  }

  /** A slider with the number beside it; both change the same value. */
  function numberInput(parent, { id, name, title, min, max, step, get, set }) {
    const range = html("input", { type: "range", id: `${id}-range`, min, max, step });
    const field = html("input", { type: "number", id, step: "any", inputmode: "decimal" });
    range.setAttribute("aria-label", `${title}, slider`);
    const label = html("label", { for: id, title });
    label.append(html("span", { class: "symbol" }, name), ` ${title}`);
    parent.append(html("div", { class: "control" }, label, range, field));
    range.addEventListener("input", () => set(Number(range.value)));
    field.addEventListener("input", () => {
      const value = field.valueAsNumber;
      const good = Number.isFinite(value) && value >= min && value <= max;
      field.setCustomValidity(good ? "" : `A number from ${min} to ${max}.`);
      field.setAttribute("aria-invalid", String(!good));
      if (good) set(value);
    });
    field.addEventListener("change", () => field.reportValidity());
    return () => {
      range.value = get();
      if (document.activeElement !== field) {
        field.value = Number(get().toPrecision(6));
        field.setCustomValidity("");
        field.setAttribute("aria-invalid", "false");
      }
    };
  }

  /** What the address after # says, as an object of strings. */
  function address() {
    return Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
  }

  /** Say which parts of an address the page left out; `read` has those that it could read. */
  function leftOut(asked, read) {
    const names = Object.keys(asked).filter((name) => !read[name]);
    document.getElementById("left-out")?.remove();
    if (!names.length) return;
    const words = `The address has parts that cannot be read and were left out: ${names.join(", ")}.`;
    document.body.prepend(html("p", { id: "left-out", role: "status" }, words));
  }

  /** Say the state in the address, so that it can be kept and sent; no new entry of the history. */
  function setAddress(values) {
    const words = new URLSearchParams(values).toString().replaceAll("%2C", ",");
    try {
      history.replaceState(null, "", `#${words}`);
    } catch {
      // some browsers limit how often; the next change says it
    }
  }

  /** Call a function at most once a frame. */
  function eachFrame(action) {
    let waiting = false;
    return () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        action();
      });
    };
  }

  const data = (name) => JSON.parse(document.getElementById(`data-${name}`).textContent);

  return { text, svg, html, Plane, draggable, numberInput, address, leftOut, setAddress, eachFrame, data };
})();
