// Moves one cursor over the pictures of a motion. It shows rows as they are: those of the plan, flown through its real
// pulse widths, or those that the workbench computes.
for (const view of document.querySelectorAll(".moving")) {
  const data = JSON.parse(view.querySelector("script").textContent);
  const part = (name) => view.querySelector(`[data-part="${name}"]`);
  const rows = {};
  for (const [name, steps] of Object.entries(data.columns)) {
    let sum = 0;
    rows[name] = steps.map((step) => (sum += step));
  }
  const planned = { ...rows };
  let last = rows.t.length - 1;
  const fires = (row) => rows.firing[row] > 0;
  const slider = part("slider");
  const speed = part("speed");
  let current = 0;

  // ---- drawing
  const make = (parent, tag, attributes, text) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    parent.append(made);
    return made;
  };
  const always = () => true;
  // Points that are shown, joined by straight lines.
  const line = (xs, ys, shown = always) => {
    const parts = [];
    let drawing = false;
    for (let row = 0; row < xs.length; row += 1) {
      const now = shown(row);
      if (now) parts.push(`${drawing ? "L" : "M"}${xs[row]} ${ys[row]}`);
      drawing = now;
    }
    return parts.join("");
  };
  // Where a pulse begins or ends the path may have a corner.
  const corner = (row) => row === 0 || row === last || rows.t[row - 1] === rows.t[row] || rows.t[row + 1] === rows.t[row]
    || (fires(row) && (rows.firing[row - 1] !== rows.firing[row] || rows.firing[row + 1] !== rows.firing[row]));
  // From row to row by how much each third of a smooth curve through the rows goes: the ends of both handles.
  const handles = (values, row) => {
    const duration = rows.t[row + 1] - rows.t[row];
    const whole = values[row + 1] - values[row];
    const way = (at) => (values[at + 1] - values[at - 1]) / (rows.t[at + 1] - rows.t[at - 1]) * duration;
    const [sharp, sharpNext] = [corner(row), corner(row + 1)];
    const end = sharpNext ? (sharp ? whole : 2 * whole - way(row)) : way(row + 1);
    const start = sharp ? 2 * whole - end : way(row);
    return [(values[row] + start / 3).toFixed(1), (values[row + 1] - end / 3).toFixed(1)];
  };
  // The path of rows that are shown, smooth; as dots where the rows are too far apart for a line.
  const curve = (xs, ys, shown = always) => {
    const parts = [];
    let drawing = false;
    for (let row = 0; row <= last; row += 1) {
      const now = shown(row);
      const [x, y] = [xs[row].toFixed(1), ys[row].toFixed(1)];
      if (now && data.dots) parts.push(`M${x} ${y}h0`);
      else if (now && !drawing) parts.push(`M${x} ${y}`);
      else if (now) {
        const [across, along] = [handles(xs, row - 1), handles(ys, row - 1)];
        parts.push(`C${across[0]} ${along[0]} ${across[1]} ${along[1]} ${x} ${y}`);
      }
      drawing = now;
    }
    return parts.join("");
  };
  const CROSS = "M-55 0H55M0 -55V55";
  const DIAMOND = "M0 -55L45 0L0 55L-45 0Z";
  const SMALL = "M0 -26L21 0L0 26L-21 0Z"; // on the globe, where a circle of few degrees is around it
  const DISC = "M-42 0a42 42 0 1 0 84 0a42 42 0 1 0 -84 0M-8 0h16"; // the Sun and other watched directions
  const place = (mark, x, y) => mark.setAttribute("transform", `translate(${x} ${y})`);

  const pole = part("pole-curves"), sky = part("sky-curves");
  const curves = [
    [pole, "axis", "pole", always], [pole, "fires", "pole", fires], [sky, "axis", "sky", always], [sky, "fires", "sky", fires],
  ].map(([parent, look, name, shown]) => ({ name, shown, path: make(parent, "path", { class: look }) }));
  const momentumPath = make(sky, "path", { class: "momentum" });
  if (data.target) place(make(sky, "path", { class: data.named[0].kind, d: DIAMOND }), ...data.target);
  const atPole = make(pole, "circle", { class: "cursor", r: 42 });
  const momentumAtSky = make(sky, "path", { class: "cursor", d: CROSS });
  const atSky = make(sky, "circle", { class: "cursor", r: 42 });
  // Dashes of a way back over the way out would fill each other's gaps.
  const oneWay = () => {
    const ways = new Set();
    const spot = (row) => `${rows.momentum1[row].toFixed(1)} ${rows.momentum2[row].toFixed(1)}`;
    return (row) => {
      const [from, to] = [spot(Math.max(row - 1, 0)), spot(row)];
      ways.add(`${from} ${to}`);
      return from === to || !ways.has(`${to} ${from}`);
    };
  };
  const drawPanels = () => {
    for (const { name, shown, path } of curves) path.setAttribute("d", curve(rows[`${name}1`], rows[`${name}2`], shown));
    momentumPath.setAttribute("d", curve(rows.momentum1, rows.momentum2, oneWay()));
  };

  const WIDE = 2000, HIGH = 1000;
  const [low, high] = data.span;
  const share = (row) => data.lead + ((1 - data.lead) * rows.t[row]) / 10 ** data.digits.t / data.until;
  const angles = ["lambda", "mu", "theta"].map((name) => ({ name, path: make(part("angles"), "path", { class: name }) }));
  const drawAngles = () => {
    const across = rows.t.map((_, row) => WIDE * share(row));
    for (const { name, path } of angles) {
      const rises = rows[name].map((v) => ((high - v / 10 ** data.digits.cone) / (high - low)) * HIGH);
      // What an impulse at t = 0 changes was there before.
      const [xs, ys] = rows.t[1] === rows.t[0] ? [[0, ...across], [rises[0], ...rises]] : [across, rises];
      path.setAttribute("d", line(xs.map((x) => x.toFixed(1)), ys.map((y) => y.toFixed(1))));
    }
    const end = part("end").style;
    const level = (high - rows.theta[last] / 10 ** data.digits.cone) / (high - low);
    [end.left, end.top] = ["100%", `calc(8.5rem * ${level.toFixed(4)})`];
  };

  // ---- rolling cones: seen along H, angles true to scale
  const degree = Math.PI / 180;
  const rolling = part("cones") && conesIn(part("cones"));
  function conesIn(svg) {
    const shapes = [["circle", "space"], ["circle", "body"], ["path", "mark"], ["path", "contact"], ["path", "cursor"]];
    const [space, body, mark, contact, cross] = shapes.map(([tag, look]) => make(svg, tag, { class: look }));
    const ring = make(svg, "circle", { class: "cursor", r: 30 });
    cross.setAttribute("d", CROSS);
    place(cross, 1000, 1000);
    const widest = Math.max(1, ...planned.theta.map((theta, row) => theta + planned.mu[row]));
    const scale = 900 / widest;
    const { sense } = data.bench.body;
    const end = (x, y, length, turn) => `${x + length * Math.cos(turn)} ${y - length * Math.sin(turn)}`;
    return (row) => {
      const way = Math.atan2(rows.momentum2[row] - rows.sky2[row], rows.sky1[row] - rows.momentum1[row]);
      const [theta, mu, lambda] = [rows.theta, rows.mu, rows.lambda].map((angle) => scale * angle[row]);
      const [x, y] = [1000 + theta * Math.cos(way), 1000 - theta * Math.sin(way)];
      const [zero1, zero2] = [0, 1].map((index) => data.bench.frame[index] + data.bench.frame[index + 2]).map((sum) => sum / 2);
      const inBody = Math.atan2(zero2 - rows.pole2[row], rows.pole1[row] - zero1);
      for (const [circle, cx, cy, r] of [[space, 1000, 1000, Math.abs(lambda)], [body, x, y, mu]]) {
        for (const [name, value] of Object.entries({ cx, cy, r })) circle.setAttribute(name, value);
      }
      contact.setAttribute("d", `M1000 1000L${end(1000, 1000, lambda, way)}L${x} ${y}`);
      // ω is towards H from the spin axis; the mark is body axis 1, which is seen from behind with spin about −3.
      mark.setAttribute("d", `M${x} ${y}L${end(x, y, mu, way + Math.PI - sense * inBody)}`);
      place(ring, x, y);
    };
  }

  // ---- one moment
  const number = (value, digits) => (value === data.none ? "–" : (value / 10 ** digits).toFixed(digits));
  const show = (row) => {
    current = Math.min(Math.max(row, 0), last);
    const t = `${number(rows.t[current], data.digits.t)} s`;
    const angle = (name) => `${number(rows[name][current], data.digits.cone)}°`;
    const firing = data.firings[rows.firing[current]];
    part("t").textContent = t;
    for (const name of ["theta", "mu", "lambda"]) part(name).textContent = angle(name);
    for (const name of Object.keys(rows).filter((key) => /^(angle|aspect)/.test(key))) {
      const value = rows[name][current];
      part(name).textContent = number(value, data.digits.angle) + (value === data.none ? "" : "°");
    }
    part("firing").textContent = firing;
    if (data.utc) part("utc").textContent = data.utc.head + data.utc.tails[current];
    part("brief").textContent = `t = ${t}, θ = ${angle("theta")}`;
    slider.value = current;
    slider.setAttribute("aria-valuetext", `${t}, nutation ${angle("theta")}${fires(current) ? `, firing ${firing}` : ""}`);
    place(atPole, rows.pole1[current], rows.pole2[current]);
    place(atSky, rows.sky1[current], rows.sky2[current]);
    place(momentumAtSky, rows.momentum1[current], rows.momentum2[current]);
    globe?.move(current);
    rolling?.(current);
    for (const svg of [pole, sky, rolling && part("cones"), globe?.svg]) svg?.classList.toggle("on", fires(current));
    part("time").style.left = `${share(current) * 100}%`;
  };
  // The last row not after a time, given in the units of the column.
  const rowAt = (t) => {
    let [first, beyond] = [0, last + 1];
    while (beyond - first > 1) {
      const middle = (first + beyond) >> 1;
      if (rows.t[middle] <= t) first = middle;
      else beyond = middle;
    }
    return first;
  };

  // ---- playing
  let playing = false, clock = 0, before = 0;
  const button = part("play");
  const play = (on) => {
    if (on === playing) return;
    playing = on;
    button.textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (current === last) show(0);
    clock = rows.t[current];
    before = performance.now();
    requestAnimationFrame(step);
  };
  const step = (now) => {
    if (!playing) return;
    const passed = Math.min(Math.max(now - before, 0), 100) / 1000; // a page in the background does not run on
    before = now;
    clock += passed * Number(speed.value) * 10 ** data.digits.t;
    let next = Math.max(rowAt(clock), current);
    if (!fires(current)) {
      // However short a pulse is, one frame shows that it fires.
      for (let row = current + 1; row < next; row += 1) if (fires(row)) next = row;
    }
    show(next);
    if (clock >= rows.t[last]) {
      show(last);
      play(false);
    } else requestAnimationFrame(step);
  };
  const stop = (row) => {
    play(false);
    show(row);
  };
  button.addEventListener("click", () => play(!playing));
  slider.style.setProperty("--lead", data.lead); // its thumb stays below the cursor
  slider.addEventListener("input", () => stop(Number(slider.value)));
  const begins = () => rows.firing.flatMap((text, row) => (text > 0 && text !== rows.firing[row - 1] ? [row] : []));
  part("back")?.addEventListener("click", () => stop(begins().filter((row) => row < current).pop() ?? 0));
  part("on")?.addEventListener("click", () => stop(begins().find((row) => row > current) ?? last));
  view.addEventListener("keydown", (event) => {
    if (event.key !== " " || /^(BUTTON|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
    event.preventDefault();
    play(!playing);
  });

  // ---- pointing
  const within = (svg, event) =>
    new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  const REACH = 120, SAME = 15;
  // The nearest row within reach; of rows that lie as near, the one next in time to the cursor.
  const nearest = (svg, event, spot) => {
    const { x, y } = within(svg, event);
    const far = rows.t.map((_, row) => {
      const [px, py, depth] = spot(row);
      return depth < 0 ? Infinity : Math.hypot(px - x, py - y);
    });
    const least = Math.min(...far);
    if (least > REACH) return null;
    let found = null;
    far.forEach((one, row) => {
      if (one <= least + SAME && (found === null || Math.abs(row - current) < Math.abs(found - current))) found = row;
    });
    return found;
  };
  // Hovering moves the cursor unless the view plays; a click pauses it.
  const follow = (target, find) => {
    const moved = (event) => {
      if (event.type === "pointermove" && playing) return;
      const row = find(event);
      if (row !== null) stop(row);
    };
    target.addEventListener("pointermove", moved);
    target.addEventListener("pointerdown", moved);
  };
  follow(part("pole"), (event) => nearest(part("pole"), event, (row) => [rows.pole1[row], rows.pole2[row], 0]));
  follow(part("sky"), (event) => nearest(part("sky"), event, (row) => [rows.sky1[row], rows.sky2[row], 0]));
  follow(part("strip"), (event) => {
    const box = part("strip").getBoundingClientRect();
    return rowAt((((event.clientX - box.left) / box.width - data.lead) / (1 - data.lead)) * rows.t[last]);
  });
  // ---- the globe: orthographic, seen from longitude and latitude of `look`, north up
  function globeIn(globe) {
    const RADIUS = 900, MIDDLE = 1000;
    let look = [...data.look];
    let see = () => [0, 0, 0];
    const aim = () => {
      const [lon, lat] = look.map((angle) => angle * degree);
      const right = [-Math.sin(lon), Math.cos(lon), 0];
      const near = [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)];
      const up = [-Math.sin(lat) * Math.cos(lon), -Math.sin(lat) * Math.sin(lon), Math.cos(lat)];
      const dot = (one, other) => one[0] * other[0] + one[1] * other[1] + one[2] * other[2];
      see = (v) => [MIDDLE + RADIUS * dot(v, right), MIDDLE - RADIUS * dot(v, up), dot(v, near)];
    };
    const onSphere = (lon, lat) => [
      Math.cos(lat * degree) * Math.cos(lon * degree),
      Math.cos(lat * degree) * Math.sin(lon * degree),
      Math.sin(lat * degree),
    ];
    const count = (number, step, from = 0) => Array.from({ length: number }, (_, index) => from + step * index);
    // The circle of half-angle `radius` rad around a direction.
    const around = (axis, radius) => {
      const aside = Math.abs(axis[2]) < 0.9 ? [-axis[1], axis[0], 0] : [0, -axis[2], axis[1]];
      const size = Math.hypot(...aside);
      const one = aside.map((x) => x / size);
      const two = [
        axis[1] * one[2] - axis[2] * one[1], axis[2] * one[0] - axis[0] * one[2], axis[0] * one[1] - axis[1] * one[0],
      ];
      const [c, s] = [Math.cos(radius), Math.sin(radius)];
      return count(121, 3).map((turn) => {
        const [cosine, sine] = [Math.cos(turn * degree), Math.sin(turn * degree)];
        return axis.map((x, index) => c * x + s * (cosine * one[index] + sine * two[index]));
      });
    };
    const unit = (...vector) => vector.map((part) => part / Math.hypot(...vector));
    const vectors = (name) => rows.t.map((_, row) => unit(rows[`${name}1`][row], rows[`${name}2`][row], rows[`${name}3`][row]));
    const axes = () => vectors("axis"), momenta = () => vectors("H");
    // What lies on the sphere: points, how they look, which rows of them and how joined; behind it lines are faint.
    const lines = [];
    const lay = (points, look, options = {}) => {
      const back = options.back === false ? null : make(globe, "path", { class: `${look} behind` });
      lines.push({ points, back, front: make(globe, "path", { class: look }), ...options });
    };
    make(globe, "circle", { cx: MIDDLE, cy: MIDDLE, r: RADIUS });
    const grid = make(globe, "g", { class: "grid" });
    const graticule = make(grid, "path", {});
    const meridians = [
      ...count(12, 30).map((lon) => count(33, 5, -80).map((lat) => onSphere(lon, lat))),
      ...count(5, 30, -60).map((lat) => count(73, 5).map((lon) => onSphere(lon, lat))),
    ];
    let seen = [];
    lay(axes, "axis", { draw: curve });
    lay(axes, "fires", { draw: curve, shown: fires, back: false });
    lay(momenta, "momentum", { draw: curve });
    for (const one of data.named) for (const { radius, kind } of one.circles) lay(() => around(one.axis, radius), kind);
    const signs = data.named.map((one) => ({
      name: one.name,
      axis: one.axis,
      mark: make(globe, "path", { class: one.kind, d: one.kind === "watched" ? DISC : one.circles.length ? SMALL : DIAMOND }),
      text: make(globe, "text", {}),
    }));
    const places = [[0, 90, "+z"], [0, -90, "−z"], ...count(4, 90).map((lon) => [lon, 0, `${lon}°`])];
    const numbers = places.map(([lon, lat, name]) => ({
      axis: onSphere(lon, lat), text: make(globe, "text", { class: "middle faint" }, name),
    }));
    const momentumAtGlobe = make(globe, "path", { class: "cursor", d: CROSS });
    const atGlobe = make(globe, "circle", { class: "cursor", r: 30 });
    // Marks behind the globe are faint.
    const put = (mark, vector) => {
      const [x, y, depth] = see(vector);
      place(mark, x.toFixed(1), y.toFixed(1));
      mark.setAttribute("opacity", depth < 0 ? 0.4 : 1);
      return depth >= 0;
    };
    const move = (row) => {
      put(momentumAtGlobe, unit(rows.H1[row], rows.H2[row], rows.H3[row]));
      put(atGlobe, unit(rows.axis1[row], rows.axis2[row], rows.axis3[row]));
    };
    const drawn = (points, join = line, shown = always) => {
      const flat = points.map(see);
      const part = (index) => flat.map((one) => Number(one[index].toFixed(1)));
      const [xs, ys] = [part(0), part(1)];
      const side = (sign) => join(xs, ys, (row) => sign * flat[row][2] >= 0 && shown(row));
      return { flat, front: side(1), back: () => side(-1) };
    };
    const draw = () => {
      aim();
      graticule.setAttribute("d", meridians.map((points) => drawn(points).front).join(""));
      for (const one of lines) {
        const made = drawn(one.points(), one.draw, one.shown);
        one.front.setAttribute("d", made.front);
        if (one.back) one.back.setAttribute("d", made.back());
        if (one.points === axes) seen = made.flat;
      }
      const taken = [];
      for (const one of signs) {
        const [x, y] = see(one.axis);
        // Away from the track where that is beside it.
        const beside = Math.abs(seen[0][1] - y) < 150 && Math.abs(seen[0][0] - x) < 400;
        const left = beside ? seen[0][0] > x : x > MIDDLE;
        const name = put(one.mark, one.axis) ? one.name : `${one.name}, behind`;
        const [wide, tall] = [name.length * 50, 80];
        const begins = left ? x - 75 - wide : x + 75;
        let down = y + 28;
        while (taken.some((box) => begins < box[1] && box[0] < begins + wide && Math.abs(box[2] - down) < tall)) down += tall;
        taken.push([begins, begins + wide, down]);
        one.text.textContent = name;
        one.text.setAttribute("class", left ? "end" : "");
        place(one.text, x + (left ? -75 : 75), down);
      }
      for (const one of numbers) {
        const [x, y] = see(one.axis);
        const free = seen.every((point) => point[2] < 0 || Math.hypot(point[0] - x, point[1] - y) > 110);
        one.text.setAttribute("visibility", put(one.text, one.axis) && free ? "visible" : "hidden");
      }
      move(current);
    };
    let held = null;
    const turn = (lon, lat) => {
      look = [look[0] + lon, Math.min(Math.max(look[1] + lat, -90), 90)];
      draw();
    };
    follow(globe, (event) => (held || event.type === "pointerdown" ? null : nearest(globe, event, (row) => seen[row])));
    globe.addEventListener("pointerdown", (event) => {
      held = within(globe, event);
      globe.setPointerCapture(event.pointerId);
    });
    globe.addEventListener("pointermove", (event) => {
      if (!held) return;
      const now = within(globe, event);
      turn((held.x - now.x) / RADIUS / degree, (now.y - held.y) / RADIUS / degree);
      held = now;
    });
    for (const name of ["pointerup", "pointercancel"]) globe.addEventListener(name, () => (held = null));
    globe.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] };
      if (event.key === "Home") look = [...data.look];
      else if (!turns[event.key]) return;
      event.preventDefault();
      turn(...(turns[event.key] ?? [0, 0]));
    });
    return { svg: globe, draw, move };
  }

  // ---- rows of another motion; null is the plan
  const globe = data.named.length ? globeIn(part("globe")) : null;
  const fly = (columns) => {
    const t = rows.t[current];
    Object.assign(rows, columns ?? planned);
    last = rows.t.length - 1;
    slider.max = last;
    current = rowAt(t);
    drawPanels();
    drawAngles();
    globe?.draw();
    show(current);
  };
  if (data.bench) workbench(view, data, fly);
  else fly(null);
  view.hidden = false;
}
