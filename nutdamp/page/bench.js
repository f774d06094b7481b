// The workbench: firings moved and stretched by hand, other values of C/A and thrust, flown at once by (17), `motion`.
const DEGREE = Math.PI / 180;
const short = (value) => String(Number(value.toPrecision(6)));

// A pulse as `motion` takes it: its impulse goes with its on-time and with the thrust.
const fired = ({ t, on, plan }, thrust) => {
  const scale = thrust * (plan.on > 0 ? on / plan.on : 1);
  return { t, on, impulse: plan.impulse.map((part) => scale * part), push: plan.torque ? thrust * plan.torque[2] : 0 };
};

// Limits of the file that the pulses break, in words; with the slack of `constraints.breaches`.
const brokenLimits = (limits, pulses) => {
  const broken = [];
  let ready = -Infinity;
  for (const { t, on, number, plan } of [...pulses].sort((one, other) => one.t - other.t)) {
    const [start, end] = [t - 0.5 * on, t + 0.5 * on];
    const slack = Math.max(1e-9, Number.EPSILON * end);
    const off = (value) => limits.tick !== null
      && Math.abs(value - Math.round(value / limits.tick) * limits.tick) > slack + 1e-6 * limits.tick;
    const tests = [
      [start < limits.earliest - (start < 0 ? 0 : slack), `start ${short(start)} s, earliest ${short(limits.earliest)} s`],
      [end > limits.horizon + slack, `end ${short(end)} s, horizon ${short(limits.horizon)} s`],
      [start < ready + limits.gap - slack, limits.gap > 0
        ? `gap ${short(start - ready)} s, minimum ${short(limits.gap)} s` : "overlaps the firing before it"],
      [on < plan.least - slack, `on-time ${short(on)} s, minimum ${short(plan.least)} s`],
      [plan.most !== null && on > plan.most + slack, `on-time ${short(on)} s, maximum ${short(plan.most ?? 0)} s`],
      [off(start), `start ${short(start)} s is no multiple of ${short(limits.tick ?? 0)} s`],
      [off(on), `on-time ${short(on)} s is no multiple of ${short(limits.tick ?? 0)} s`],
      ...limits.blackout.map(([begins, ends]) => [
        Math.min(ends - start, end - begins) > slack, `fires in the blackout ${short(begins)} s to ${short(ends)} s`,
      ]),
    ];
    for (const [breaks, text] of tests) if (breaks) broken.push(`pulse ${number}: ${text}`);
    ready = Math.max(ready, end);
  }
  if (limits.most !== null && pulses.length > limits.most) broken.push(`pulses: ${pulses.length}, maximum ${limits.most}`);
  return broken;
};

// The pulses as a schedule file: vectors in the axes of the file, with the thrust of the file.
const scheduleCsv = (pulses, axes) => {
  const inFile = (vector) => (axes ? axes.map((row) => motion.dot(row, vector)) : vector);
  const names = ["torque", "impulse"].flatMap((name) => [1, 2, 3].map((axis) => `${name}_${axis}_${name === "torque" ? "Nm" : "Nms"}`));
  const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const lines = [...pulses].sort((one, other) => one.t - other.t).map((pulse) => [
    pulse.t - 0.5 * pulse.on, pulse.on, quoted(pulse.plan.channel),
    ...(pulse.plan.torque ? inFile(pulse.plan.torque) : ["", "", ""]), ...inFile(fired(pulse, 1).impulse),
  ].join(","));
  return [["start_s", "on_time_s", "channel", ...names].join(","), ...lines, ""].join("\n");
};

// Rows of a motion by impulses, in the units of the rows of the page.
const impulseRows = (data, body, arcs, pulses) => {
  const { bench, digits, until } = data;
  const [left, top, right, bottom] = bench.frame;
  const placed = ([x, y], [middle, height, half]) => [
    left + ((x - middle + half) / (2 * half)) * (right - left), bottom - ((y - height + half) / (2 * half)) * (bottom - top),
  ];
  // Angles from H(0), true to scale along every radius.
  const onSky = (vector) => {
    const [x, y, z] = bench.plane.map((row) => motion.dot(row, vector)), across = Math.hypot(x, y);
    const scale = across > 0 ? Math.atan2(across, z) / DEGREE / across : 0;
    return [x * scale, y * scale];
  };
  const pointing = ([x, y, z]) => {
    const across = Math.hypot(x, y);
    const about = Math.atan2(across, Math.abs(z)) < 1e-12 ? null : (Math.atan2(y, x) / DEGREE + 360) % 360;
    return bench.framed ? [about, Math.atan2(z, across) / DEGREE] : [Math.atan2(across, z) / DEGREE, about];
  };
  const firingAt = (t) => {
    const text = pulses.filter(({ t: centre, on }) => Math.abs(t - centre) <= 0.5 * on + 1e-9)
      .map(({ plan, number }) => `${number}: ${plan.text}`).join(" and ") || data.firings[0];
    if (!data.firings.includes(text)) data.firings.push(text);
    return data.firings.indexOf(text);
  };
  const whole = (value, name) => (value === null ? data.none : value * 10 ** digits[name]);
  const row = (t, state) => {
    const { nutation, bodyCone, spaceCone } = motion.cones(body, state);
    const axis = motion.axis(body, state), momentum = motion.momentum(body, state);
    const size = Math.hypot(...momentum);
    const vectors = {
      pole: placed(state.omega.map((rate) => rate / DEGREE), bench.pole), sky: placed(onSky(axis), bench.sky),
      momentum: placed(onSky(momentum), bench.sky), axis, H: momentum.map((part) => part / size),
      angle: pointing(axis).map((value) => whole(value, "angle")),
      aspect: data.named.filter((direction) => direction.watched)
        .map((direction) => whole(motion.angle(axis, direction.axis) / DEGREE, "angle")),
    };
    const cones = { theta: nutation, mu: bodyCone, lambda: spaceCone };
    return Object.fromEntries([
      ["t", whole(t, "t")], ["firing", firingAt(t)],
      ...Object.entries(cones).map(([name, value]) => [name, whole(value / DEGREE, "cone")]),
      ...Object.entries(vectors).flatMap(([name, parts]) => parts.map((value, index) => [`${name}${index + 1}`, value])),
    ]);
  };
  const rows = [], step = until / (data.samples - 1);
  arcs.forEach(({ start, state }, index) => {
    if (start > until) return;
    const end = Math.min(arcs[index + 1]?.start ?? until, until);
    const inner = [];
    for (let number = Math.floor(start / step) + 1; number * step < end; number += 1) inner.push(number * step);
    for (const t of [start, ...inner, end]) rows.push(row(t, motion.arc(body, state, t - start)));
  });
  return Object.fromEntries(Object.keys(rows[0]).map((name) => [name, rows.map((entry) => entry[name])]));
};

// Puts the workbench of a view to work; `show` shows rows in place of those of the plan, which null brings back.
function workbench(view, data, show) {
  const { bench } = data;
  const part = (name) => view.querySelector(`[data-part="${name}"]`);
  const planned = () => bench.pulses.map((plan, index) => ({ t: plan.t, on: plan.on, plan, number: index + 1 }));
  const [ratio, thrust, select, begin, width] = ["ratio", "thrust", "pulse", "begin", "width"].map(part);
  const step = bench.limits.tick ?? bench.step;
  const snapped = (value) => Number((Math.round(value / step) * step).toPrecision(12));
  let pulses = planned(), waiting = false;

  // ---- the end
  const flight = (list, percent) => {
    const [body, start] = motion.changed(bench.body, bench.start, 1 + percent.ratio / 100, bench.framed);
    const arcs = motion.fly(body, start, list.map((pulse) => fired(pulse, 1 + percent.thrust / 100)));
    const left = motion.residual(body, arcs);
    return { body, arcs, left: { ...left, spin: Math.abs(left.spin - (bench.spin ?? left.spin)) } };
  };
  const percents = () => ({ ratio: Number(ratio.value), thrust: Number(thrust.value) });
  const unchanged = () => Object.values(percents()).every((value) => value === 0)
    && pulses.every(({ t, on, plan }) => t === plan.t && on === plan.on);
  const valueText = (key, value) => {
    const shown = key === "spin" ? value : value / DEGREE;
    const text = shown === 0 ? "0" : shown < 1e-9 ? "< 1e-9" : shown.toPrecision(4);
    return text + (key === "spin" ? " rad/s" : "°");
  };
  const put = (cell, key, value) => {
    cell.value = String(value);
    cell.textContent = valueText(key, value);
  };
  const judge = (cell, met) => {
    cell.textContent = met ? "met" : "NOT met";
    cell.classList.toggle("missed", !met);
  };
  const keys = [...view.querySelectorAll("[data-row]")].map((row) => row.dataset.row);
  const summary = (left, broken) => [
    ...keys.map((key) => `${key.replace("_", " ")} ${valueText(key, left[key])} ${part(`verdict-${key}`).textContent}`),
    broken.length ? `limits NOT met: ${broken.join("; ")}` : "limits met",
  ].join(", ");
  const showEnd = ({ left }) => {
    const broken = brokenLimits(bench.limits, pulses);
    for (const key of keys) {
      put(part(`now-${key}`), key, left[key]);
      if (key in bench.required) judge(part(`verdict-${key}`), left[key] <= bench.required[key]);
    }
    judge(part("verdict-limits"), broken.length === 0);
    part("broken").textContent = broken.join("; ");
    return summary(left, broken);
  };

  // ---- what is changed, and how it is shown
  const bars = pulses.map((_, index) => firingBar(index));
  const showPulses = () => pulses.forEach(({ t, on }, index) => {
    const across = (time) => 100 * (data.lead + ((1 - data.lead) * time) / data.until);
    bars[index].style.left = `${across(t - 0.5 * on)}%`;
    bars[index].style.width = `${across(0.5 * on) - across(-0.5 * on)}%`;
    bars[index].classList.toggle("chosen", index === select.selectedIndex);
  });
  const showFields = () => {
    const { t, on, plan } = pulses[select.selectedIndex];
    begin.value = Number((t - 0.5 * on).toFixed(9));
    width.value = plan.on > 0 ? Number(on.toFixed(9)) : "";
    width.disabled = plan.on === 0;
  };
  const showPercents = (text) => {
    for (const [name, value] of Object.entries(percents())) {
      part(`${name}-text`).textContent = `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(2)} %`;
      part(name).setAttribute("aria-valuetext", `${value} %: ${text}`);
    }
  };
  const draw = () => {
    waiting = false;
    const now = flight(pulses, percents()), plan = unchanged();
    const text = showEnd(now);
    showPulses();
    showPercents(text);
    view.classList.toggle("changed", !plan);
    part("reset").disabled = plan;
    part("shown").textContent = plan ? part("shown").dataset.plan : part("shown").dataset.changed;
    show(plan ? null : impulseRows(data, now.body, now.arcs, pulses));
    return text;
  };
  const soon = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  const settled = () => (part("summary").textContent = draw());
  const change = (index, start, on) => {
    pulses[index] = { ...pulses[index], on, t: start + 0.5 * on };
    soon();
  };

  // ---- bars: the middle moves a firing, an edge changes its on-time
  function firingBar(index) {
    const bar = document.createElement("div");
    bar.className = "firing";
    bar.title = `${index + 1}: ${bench.pulses[index].text}`;
    bar.style.top = `${1.4 * bench.pulses[index].row + 0.3}rem`;
    const edges = bench.pulses[index].on > 0 ? ["first", "last"] : [];
    bar.append(...["middle", ...edges].map((name) => {
      const grip = document.createElement("i");
      grip.className = name;
      return grip;
    }));
    bar.addEventListener("pointerdown", (event) => drag(bar, index, event));
    part("firings").append(bar);
    return bar;
  }
  function drag(bar, index, event) {
    event.preventDefault();
    event.stopPropagation();
    select.selectedIndex = index;
    const { t, on } = pulses[index], start = t - 0.5 * on, end = t + 0.5 * on, grip = event.target.className;
    const second = data.until / ((1 - data.lead) * part("firings").getBoundingClientRect().width);
    const moved = (now) => {
      const by = (now.clientX - event.clientX) * second;
      if (grip === "last") change(index, start, Math.max(snapped(on + by), step));
      else if (grip === "first") {
        const from = Math.min(Math.max(snapped(start + by), 0), end - step);
        change(index, from, end - from);
      } else change(index, Math.min(Math.max(snapped(start + by), 0), Math.max(data.until - on, 0)), on);
      showFields();
    };
    const over = () => {
      bar.removeEventListener("pointermove", moved);
      settled();
    };
    bar.setPointerCapture(event.pointerId);
    bar.addEventListener("pointermove", moved);
    bar.addEventListener("pointerup", over, { once: true });
    bar.addEventListener("pointercancel", over, { once: true });
    showFields();
    showPulses();
  }

  // ---- fields, sliders and buttons
  const copy = async (text, name) => {
    const field = part("text"), values = percents();
    field.value = text;
    try {
      await navigator.clipboard.writeText(text);
      field.hidden = true;
      part("summary").textContent = `${name} copied`;
      part("copied").textContent = values.ratio || values.thrust ? "Copied; the file has no change of C/A or thrust." : "Copied.";
    } catch {
      field.hidden = false;
      field.select();
      part("copied").textContent = "Press Ctrl+C to copy.";
    }
  };
  // Of start and on-time only the one that is typed changes: what a field shows of the other is rounded.
  const typed = (field, apply) => {
    field.step = step;
    field.addEventListener("input", () => {
      const { t, on } = pulses[select.selectedIndex], value = field.valueAsNumber;
      if (value >= 0) apply(value, t - 0.5 * on, on);
    });
    field.addEventListener("change", () => {
      showFields();
      settled();
    });
  };
  typed(begin, (value, _, on) => change(select.selectedIndex, value, on));
  typed(width, (value, start) => value > 0 && change(select.selectedIndex, start, value));
  for (const slider of [ratio, thrust]) {
    slider.addEventListener("input", soon);
    slider.addEventListener("change", settled);
  }
  select.addEventListener("change", () => {
    showFields();
    showPulses();
  });
  part("reset").addEventListener("click", () => {
    pulses = planned();
    [ratio.value, thrust.value] = [0, 0];
    showFields();
    settled();
    part("copied").textContent = "";
    begin.focus();
  });
  part("copy-csv").addEventListener("click", () => copy(scheduleCsv(pulses, bench.axes), "CSV"));
  part("copy-command").addEventListener("click", () => copy(part("copy-command").dataset.command, "Command"));

  const { left } = flight(pulses, { ratio: 0, thrust: 0 });
  for (const key of keys) put(part(`plan-${key}`), key, left[key]);
  [ratio.value, thrust.value, select.selectedIndex] = [0, 0, 0];
  showFields();
  draw();
}
