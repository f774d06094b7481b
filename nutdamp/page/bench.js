// The workbench: firings moved and stretched by hand, other values of C/A and thrust, flown at once by
// `motion`. It shows values beside their limits and judges nothing: that is for `nutdamp simulate`.
const DEGREE = Math.PI / 180;
const EDITED = "EDITED – NOT THE PLAN ABOVE";
const short = (value) => String(Number(value.toPrecision(6)));

// A pulse as `motion` takes it: its impulse goes with its on-time and with the thrust.
const fired = ({ start, on, plan }, thrust) => {
  const scale = thrust * (plan.on > 0 ? on / plan.on : 1);
  const impulse = plan.impulse.map((part) => scale * part);
  return { start, end: start + on, impulse, torque: plan.torque?.map((part) => thrust * part) };
};

const inOrder = (pulses) => [...pulses].sort((one, other) => one.start - other.start);

// Limits of the file that the pulses break, in words; with the slack of `constraints.breaches`.
const brokenLimits = (limits, pulses) => {
  const broken = [];
  let ready = -Infinity;
  for (const { start, on, number, plan } of inOrder(pulses)) {
    const end = start + on, slack = Math.max(1e-9, Number.EPSILON * end);
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
  const lines = inOrder(pulses).map((pulse) => [
    pulse.start, pulse.on, quoted(pulse.plan.channel),
    ...(pulse.plan.torque ? inFile(pulse.plan.torque) : ["", "", ""]), ...inFile(fired(pulse, 1).impulse),
  ].join(","));
  return [["start_s", "on_time_s", "channel", ...names].join(","), ...lines, ""].join("\n");
};

// Columns of a flight in the units of those of the page.
const flownColumns = (data, body, flown, pulses) => {
  const { bench, digits } = data;
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
    const text = pulses.filter(({ start, on }) => start <= t && t <= start + on)
      .map(({ plan, number }) => `${number}: ${plan.text}`).join(" and ") || data.firings[0];
    if (!data.firings.includes(text)) data.firings.push(text);
    return data.firings.indexOf(text);
  };
  const whole = (value, name) => (value === null ? data.none : value * 10 ** digits[name]);
  const row = ([t, state]) => {
    const { nutation, bodyCone, spaceCone } = motion.cones(body, state);
    const axis = motion.axis(body, state), momentum = motion.momentum(body, state);
    const size = Math.hypot(...momentum);
    const vectors = {
      pole: placed([state[0] / DEGREE, state[1] / DEGREE], bench.pole), sky: placed(onSky(axis), bench.sky),
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
  const rows = flown.filter(([t]) => t <= data.until).map(row);
  return Object.fromEntries(Object.keys(rows[0]).map((name) => [name, rows.map((entry) => entry[name])]));
};

// Puts the workbench of a view to work; `show` shows rows in place of those of the plan, which null brings back.
function workbench(view, data, show) {
  const { bench } = data;
  const part = (name) => view.querySelector(`[data-part="${name}"]`);
  const planned = () => bench.pulses.map((plan, index) => {
    const { start, on } = plan;
    return { start, on, plan, number: index + 1 };
  });
  const [ratio, thrust, select, begin, width] = ["ratio", "thrust", "pulse", "begin", "width"].map(part);
  const step = bench.limits.tick ?? bench.step;
  const snapped = (value) => Number((Math.round(value / step) * step).toPrecision(12));
  const times = Array.from({ length: data.samples }, (_, row) => (row / (data.samples - 1)) * data.until);
  let pulses = planned(), waiting = false;

  // ---- the end
  const flight = (list, percent) => {
    const [body, start] = motion.changed(bench.body, bench.start, 1 + percent.ratio / 100, bench.framed);
    const firings = list.map((pulse) => fired(pulse, 1 + percent.thrust / 100));
    const { rows, settled } = motion.fly(body, start, firings, times);
    const left = motion.residual(body, start, settled);
    return { body, rows, left: { ...left, spin: Math.abs(left.spin - (bench.spin ?? left.spin)) } };
  };
  const percents = () => ({ ratio: Number(ratio.value), thrust: Number(thrust.value) });
  const unchanged = () => Object.values(percents()).every((value) => value === 0)
    && pulses.every(({ start, on, plan }) => start === plan.start && on === plan.on);
  const valueText = (key, value) => {
    const shown = key === "spin" ? value : value / DEGREE;
    const text = shown < 1e-9 ? "0" : shown.toPrecision(4);
    return text + (key === "spin" ? " rad/s" : "°");
  };
  const put = (cell, key, value) => {
    cell.value = String(value);
    cell.textContent = valueText(key, value);
  };
  const keys = [...view.querySelectorAll("[data-row]")].map((row) => row.dataset.row);
  const showEnd = (left) => {
    const broken = brokenLimits(bench.limits, pulses);
    for (const key of keys) put(part(`now-${key}`), key, left[key]);
    part("broken").textContent = broken.length ? `limits broken: ${broken.join("; ")}` : "";
    const values = keys.map((key) => {
      const limit = part(`limit-${key}`).textContent;
      return `${key.replace("_", " ")} ${valueText(key, left[key])}, limit ${limit}`;
    });
    return [...values, part("broken").textContent].filter(Boolean).join("; ");
  };

  // ---- what is changed, and how it is shown
  const bars = pulses.map((_, index) => firingBar(index));
  const showPulses = () => pulses.forEach(({ start, on }, index) => {
    const across = (time) => 100 * (data.lead + ((1 - data.lead) * time) / data.until);
    bars[index].style.left = `${across(start)}%`;
    bars[index].style.width = `${across(on) - across(0)}%`;
    bars[index].classList.toggle("chosen", index === select.selectedIndex);
  });
  const showFields = () => {
    const { start, on, plan } = pulses[select.selectedIndex];
    begin.value = start;
    width.value = plan.on > 0 ? on : "";
    width.disabled = plan.on === 0;
  };
  const showPercents = (text) => {
    for (const [name, value] of Object.entries(percents())) {
      part(`${name}-text`).textContent = `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(2)} %`;
      part(name).setAttribute("aria-valuetext", `${value} %: ${text}`);
    }
  };
  const showEdited = (text) => {
    for (const banner of document.querySelectorAll(".edited")) {
      if (banner.textContent !== text) banner.textContent = text; // else it would be read out again
    }
  };
  const draw = () => {
    waiting = false;
    const { body, rows, left } = flight(pulses, percents()), plan = unchanged();
    const text = showEnd(left);
    showPulses();
    showPercents(text);
    showEdited(plan ? "" : EDITED);
    view.classList.toggle("changed", !plan);
    part("reset").disabled = plan;
    show(plan ? null : flownColumns(data, body, rows, pulses));
    return text;
  };
  const soon = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  const settled = () => (part("summary").textContent = draw());
  const change = (index, start, on) => {
    pulses[index] = { ...pulses[index], start, on };
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
    const { start, on } = pulses[index], end = start + on, grip = event.target.className;
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
  const typed = (field, apply) => {
    field.step = step;
    field.addEventListener("input", () => {
      const { start, on } = pulses[select.selectedIndex], value = field.valueAsNumber;
      if (value >= 0) apply(value, start, on);
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
  part("copy-command").addEventListener("click", () => copy(part("command").textContent, "Command"));

  [ratio.value, thrust.value, select.selectedIndex] = [0, 0, 0];
  const { left } = flight(pulses, percents());
  for (const key of keys) put(part(`plan-${key}`), key, left[key]);
  showFields();
  draw();
}
