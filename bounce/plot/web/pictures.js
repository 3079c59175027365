// The pictures of the page on one bounce: friction cone, slip in time, outcome map, and the ball itself.
"use strict";

const Pictures = (() => {
  const { svg, html, text } = Page;
  const NAMES = { "+": "forward", "-": "reverse", s: "rolling", F: "free" };
  const nameOf = (mode) => NAMES[mode] ?? "free";

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

  /** Friction against load, with the cone that bounds it. */
  function drawCone(cone, all, mu) {
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
      parts.push(cone.path(own.map(read), { class: `phase phase-${nameOf(mode)}` }));
    });
    for (const { mode, points: own } of all) {
      const line = own.map(read);
      if (length(cone, line) > 30)
        parts.push(cone.arrow(line, 0.45, { class: `head-${nameOf(mode)}` }, 7));
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

  /** Slip in time, phase by phase. */
  function drawSlip(slip, all, time) {
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
      parts.push(slip.path(points.map(read), { class: `phase phase-${nameOf(mode)}` }));
    }
    slip.layer.replaceChildren(...parts, ...enlarged(slip, all, high - low));
    slip.over.replaceChildren(...marks(slip, all, read));
    slip.ticks("time", "slip H = Ẋ + Ω");
  }

  /** The last slip in a frame of its own, where it is too small to be seen beside the first. */
  function enlarged(slip, all, range) {
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
        class: `phase end phase-${nameOf(mode)}`,
      }),
      ...lines.map((line, k) => svg("text", below(k), line)),
    ];
  }

  const luminance = (colour) => {
    const parts = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16) / 255);
    const linear = parts.map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const bare = (name) => name.replace(/^F /, ""); // a map has all landings with F, or none

  /** Colours of regions: their own, or spare ones that are kept while sliders move. */
  class Colours {
    constructor({ colours, more }) {
      Object.assign(this, { colours, more, spare: {} });
    }

    of(name) {
      return this.colours[bare(name)] || this.spare[bare(name)];
    }

    /** Give the regions of a map colours; those that share one by chance get others. */
    assign(regions) {
      const { colours, more, spare } = this;
      const used = new Set(Object.values(colours));
      for (const name of regions.map(bare)) {
        if (colours[name]) continue;
        if (!spare[name] || used.has(spare[name])) {
          const free = more.find((colour) => !used.has(colour));
          spare[name] = free || more[Object.keys(spare).length % more.length];
        }
        used.add(spare[name]);
      }
    }
  }

  function picture(outcomes, colours) {
    const { count, code, regions } = outcomes;
    const canvas = html("canvas", { width: count, height: count });
    const context = canvas.getContext("2d");
    const image = context.createImageData(count, count);
    const fills = regions.map((name) => {
      const colour = colours.of(name);
      return [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
    });
    for (let at = 0; at < code.length; at++) {
      const row = count - 1 - Math.floor(at / count);
      const to = 4 * (row * count + (at % count));
      const [r, g, b] = code[at] < 0 ? [255, 255, 255] : fills[code[at]];
      image.data.set([r, g, b, 255], to);
    }
    context.putImageData(image, 0, 0);
    return canvas.toDataURL();
  }

  /** Regions of a map, their names where there is room, the others in a key, and the dividing curve. */
  function drawMap(map, key, outcomes, colours) {
    const shares = Maps.shares(outcomes);
    colours.assign(shares.map(({ name }) => name));
    const [u, v] = outcomes.reach;
    const [left, top] = map.at([-u, v]);
    const [right, bottom] = map.at([u, -v]);
    const box = {
      x: left,
      y: top,
      width: right - left,
      height: bottom - top,
      preserveAspectRatio: "none",
    };
    const image = svg("image", { ...box, href: picture(outcomes, colours), class: "regions" });
    const lines = Maps.curve(outcomes).map(({ kind, points }) =>
      map.path(points, { class: `divide ${kind}` }),
    );
    const rooms = Maps.rooms(outcomes);
    const names = [];
    const small = [];
    for (const { code, name, share } of shares) {
      const words = name.replaceAll("-", "−");
      const place = Maps.label(
        outcomes,
        code,
        rooms[code],
        (9.5 * words.length + 8) / map.box.width,
      );
      if (place && rooms[code].room > 0.03 * outcomes.count) {
        const fill = luminance(colours.of(name)) < 0.2 ? "#ffffff" : "#000000";
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
          svg("rect", {
            x: 1,
            y: 1,
            width: 32,
            height: 12,
            fill: colours.of(name),
            class: "swatch",
          }),
        );
        small.push(html("li", {}, box, words));
      }
    }
    map.under.replaceChildren(image);
    map.layer.replaceChildren(...lines, ...names);
    key.replaceChildren(...small);
    map.ticks("speed Ẋ", "spin Ω");
  }

  /** The ball beside its ground: it sinks in, turns, and is pushed along by friction. */
  class Ball {
    constructor(element) {
      this.plane = new Page.Plane(element, {
        x: [-1, 1],
        y: [-1, 1],
        aspect: 0.42,
        margin: [4, 4, 4, 4],
      });
      this.plane.frame.remove();
    }

    /** Draw a point of a bounce; `reach` are the least and the largest x of it. */
    draw(point, reach, mode, most) {
      const { plane } = this;
      const middle = (reach[0] + reach[1]) / 2;
      const { left, width, top, height } = plane.box;
      const tall = Math.max(((reach[1] - reach[0] + 2.6) * height) / width, 3.6); // in radii
      const half = (tall * width) / height / 2;
      plane.limits([middle - half, middle + half], [-1.2, tall - 1.2]); // heights above the ground
      const centre = [point.x, 1 + point.y];
      const [cx, cy] = plane.at(centre);
      const r = cx - plane.at([point.x - 1, 0])[0];
      const [, ground] = plane.at([0, 0]);
      const spoke = (turn) => {
        const [x, y] = [0.82 * Math.cos(point.angle + turn), 0.82 * Math.sin(point.angle + turn)];
        const [a, b] = plane.at([centre[0] + x, centre[1] + y]);
        return `M${cx} ${cy}L${a} ${b}`;
      };
      const push = most > 0 ? (0.9 * r * point.friction) / most : 0;
      const tip = Math.sign(push) * Math.min(7, Math.abs(push));
      plane.layer.replaceChildren(
        svg("rect", { x: left, y: ground, width, height: top + height - ground, class: "ground" }),
        svg("circle", { cx, cy, r, class: `ball ball-${nameOf(mode)}` }),
        svg("path", {
          d: [0, 1, 2].map((k) => spoke((2 * Math.PI * k) / 3)).join(""),
          class: "spoke",
        }),
        svg("path", {
          d: `M${cx} ${cy + r}h${push}m${-tip} -4l${tip} 4l${-tip} 4`,
          class: `push phase-${nameOf(mode)}`,
        }),
      );
    }
  }

  return { Ball, Colours, drawCone, drawMap, drawSlip, nameOf };
})();
