// Maps of outcomes over the landings (xdot, omega), and the curve that divides forward from reverse slip.
"use strict";

const Maps = (() => {
  /** Middles of `count` cells from -reach to reach; an even count misses H = 0, where regions are lines. */
  function middles(reach, count) {
    return Array.from({ length: count }, (_, k) => ((2 * k + 1) / count - 1) * reach);
  }

  /** An empty map: `code` counts through `regions` (-1: no lift-off), `side` is that of lift-off. */
  function empty(contact, p, ydot, reach, count) {
    const [xdot, omega] = reach.map((r) => middles(r, count));
    const code = new Int16Array(count * count).fill(-1);
    const side = new Int8Array(count * count);
    const rolled = new Uint8Array(count * count); // whether the last slip began by leaving rolling
    return {
      contact,
      p,
      ydot,
      reach,
      count,
      xdot,
      omega,
      code,
      side,
      rolled,
      regions: [],
      done: 0,
      divided: 0,
      crossings: new Map(),
      pieces: [],
    };
  }

  const MIRRORED = { "+": "-", "-": "+" };
  const mirror = (itinerary) => itinerary.replace(/[+-]/g, (sign) => MIRRORED[sign]);

  function put(map, at, { fault, itinerary }) {
    if (fault) return;
    const name = regionName(itinerary);
    let code = map.regions.indexOf(name);
    if (code < 0) code = map.regions.push(name) - 1;
    map.code[at] = code;
    map.side[at] = { "+": 1, "-": -1 }[itinerary.at(-1)] || 0;
    map.rolled[at] = itinerary.at(-3) === "s" ? 1 : 0;
  }

  /** Compute rows for at most `milliseconds`; true when the map is complete. Half of it is mirrored, if it may be. */
  function compute(map, milliseconds) {
    const { contact, p, ydot, count, xdot, omega } = map;
    const { mirrored } = contact.given;
    const until = performance.now() + milliseconds;
    for (; map.done < count / (mirrored ? 2 : 1); map.done++) {
      if (performance.now() > until) return false;
      const j = map.done;
      const landings = xdot.map((own) => ({ xdot: own, ydot, omega: omega[j] }));
      contact.many(p, landings).forEach((shot, i) => {
        put(map, j * count + i, shot);
        const other = { ...shot, itinerary: mirror(shot.itinerary) };
        if (mirrored) put(map, (count - 1 - j) * count + count - 1 - i, other);
      });
    }
    return true;
  }

  /** Share of the map in each region, the largest first. */
  function shares(map) {
    const counts = new Array(map.regions.length).fill(0);
    for (const code of map.code) if (code >= 0) counts[code]++;
    return counts
      .map((n, code) => ({ code, name: map.regions[code], share: n / map.code.length }))
      .sort((a, b) => b.share - a.share);
  }

  /** For each region the cell that is farthest from others, and how many cells that is (chamfer). */
  function rooms(map) {
    const { count: n, code } = map;
    const far = new Float64Array(n * n);
    const same = (at, i, j) => i >= 0 && i < n && j >= 0 && j < n && code[j * n + i] === code[at];
    const sweep = (order, ways) => {
      for (const j of order) {
        for (const i of order) {
          const at = j * n + i;
          for (const [di, dj] of ways) {
            const room = same(at, i + di, j + dj)
              ? far[(j + dj) * n + i + di] + Math.hypot(di, dj)
              : 1;
            if (room < far[at]) far[at] = room;
          }
        }
      }
    };
    far.fill(Infinity);
    const up = Array.from({ length: n }, (_, k) => k);
    sweep(up, [
      [-1, 0],
      [0, -1],
      [-1, -1],
      [1, -1],
    ]);
    sweep([...up].reverse(), [
      [1, 0],
      [0, 1],
      [1, 1],
      [-1, 1],
    ]);
    const best = map.regions.map(() => ({ room: 0, xdot: 0, omega: 0 }));
    for (let at = 0; at < code.length; at++) {
      if (code[at] < 0 || far[at] <= best[code[at]].room) continue;
      best[code[at]] = {
        room: far[at],
        xdot: map.xdot[at % n],
        omega: map.omega[Math.floor(at / n)],
      };
    }
    return best;
  }

  /** Middle of a region where a label as wide as a share of the map stays inside it; null if none. */
  function label(map, code, { xdot, omega }, share) {
    const n = map.count;
    const j = map.omega.indexOf(omega);
    const at = map.xdot.indexOf(xdot);
    const row = map.code.slice(j * n, (j + 1) * n);
    let [first, last] = [at, at];
    while (first > 0 && row[first - 1] === code) first--;
    while (last < n - 1 && row[last + 1] === code) last++;
    if (last - first + 1 < share * n) return null;
    const half = Math.ceil((share * n) / 2);
    const middle = Math.min(Math.max(at, first + half), last - half);
    return [map.xdot[Math.min(Math.max(middle, 0), n - 1)], omega];
  }

  /** Where a curve crosses the edge between two cells, found once: the point, and the kind of the arc. */
  function crossing(map, found, a, b, tolerance) {
    const name = a < b ? `${a} ${b}` : `${b} ${a}`;
    if (!found.has(name)) {
      const n = map.count;
      const [one, other] = [a, b].map((at) => [map.xdot[at % n], map.omega[Math.floor(at / n)]]);
      const point = map.contact.divide(map.p, map.ydot, one, other, tolerance);
      const kind = map.rolled[a] && map.rolled[b] ? "two-fold" : "slipping";
      found.set(name, { name, point, kind });
    }
    return found.get(name);
  }

  /** Pieces of the curve H_F = 0 in a cell between four neighbours; their ends lie on its edges. */
  function pieces(map, found, i, j, tolerance) {
    const n = map.count;
    const corners = [j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i];
    const cut = [];
    corners.forEach((a, k) => {
      const b = corners[(k + 1) % 4];
      if (map.side[a] * map.side[b] < 0) cut.push(crossing(map, found, a, b, tolerance));
    });
    if (cut.length === 2) return [cut];
    return cut.length === 4
      ? [
          [cut[0], cut[1]],
          [cut[2], cut[3]],
        ]
      : [];
  }

  /** Find pieces of the curve for at most `milliseconds`, row by row; true when all are found. */
  function divide(map, tolerance, milliseconds) {
    const until = performance.now() + milliseconds;
    const { mirrored } = map.contact.given;
    const last = mirrored ? map.count / 2 - 1 : map.count - 2; // a row of cells that is its own mirror image, or the last
    for (; map.divided <= last; map.divided++) {
      if (performance.now() > until) return false;
      for (let i = 0; i < map.count - 1; i++) {
        for (const piece of pieces(map, map.crossings, i, map.divided, tolerance)) {
          map.pieces.push(piece);
          if (mirrored && map.divided < last) map.pieces.push(piece.map(mirrorEnd));
        }
      }
    }
    return true;
  }

  const mirrorEnd = ({ name, point, kind }) => ({
    name: `mirror ${name}`,
    point: [-point[0], -point[1]],
    kind,
  });

  /** The curve as polylines, each of one kind: its pieces joined at the ends that they share. */
  function curve(map) {
    const left = new Set(map.pieces);
    const meeting = new Map();
    for (const piece of map.pieces) {
      for (const end of piece) meeting.set(end.name, [...(meeting.get(end.name) || []), piece]);
    }
    const extend = (line) => {
      for (;;) {
        const end = line.at(-1);
        const next = meeting.get(end.name).find((piece) => left.has(piece));
        if (!next) return line;
        left.delete(next);
        line.push(next[0].name === end.name ? next[1] : next[0]);
      }
    };
    const lines = [];
    for (const piece of map.pieces) {
      if (left.delete(piece)) lines.push(extend(extend([...piece]).reverse()));
    }
    return lines.flatMap(byKind);
  }

  /** Cut a polyline where its kind changes; both parts have the point there. */
  function byKind(line) {
    const parts = [{ kind: line[0].kind, points: [line[0].point] }];
    for (const { kind, point } of line.slice(1)) {
      parts.at(-1).points.push(point);
      if (kind !== parts.at(-1).kind) parts.push({ kind, points: [point] });
    }
    return parts.filter((part) => part.points.length > 1);
  }

  return { empty, compute, divide, curve, shares, rooms, label };
})();
