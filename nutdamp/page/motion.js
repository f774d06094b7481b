// Motion of a rigid body through the real widths of its pulses, as `flight.propagation.flown`: pure
// functions, SI and rad, in principal axes. A body is {moments, sense, target}; a pulse {start, end,
// torque, impulse} acts at once where both times are one; a state is [ω1, ω2, ω3, w, x, y, z], and its
// quaternion leads from the body to inertial space. Numbers of equations: Magnus 1970.
const motion = (() => {
  const dot = (u, v) => u.reduce((sum, x, index) => sum + x * v[index], 0);
  const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
  const angle = (u, v) => Math.atan2(Math.hypot(...cross(u, v)), dot(u, v));
  const product = ([p, a, b, c], [w, x, y, z]) => [
    p * w - a * x - b * y - c * z, p * x + a * w + b * z - c * y,
    p * y - a * z + b * w + c * x, p * z + a * y - b * x + c * w,
  ];
  const inSpace = ([, , , w, ...v], u) => {
    const twice = cross(v, u).map((x) => 2 * x);
    return cross(v, twice).map((x, index) => u[index] + w * twice[index] + x);
  };
  const inBody = ({ moments }, state) => moments.map((moment, index) => moment * state[index]);
  const momentum = (body, state) => inSpace(state, inBody(body, state));
  const axis = (body, state) => inSpace(state, [0, 0, body.sense]);

  // Coast of a symmetric body (fig. 4): it turns about H by |H|/A and about its axis by aω3.
  const arc = (body, [p, q, r, ...turn], since) => {
    const [A, , C] = body.moments, h = inBody(body, [p, q, r]), size = Math.hypot(...h);
    const own = ((A - C) / A) * r * since, about = (0.5 * size * since) / A;
    const part = size > 0 ? Math.sin(about) / size : 0;
    const turned = product(turn, [Math.cos(about), ...h.map((x) => part * x)]);
    return [
      p * Math.cos(own) + q * Math.sin(own), q * Math.cos(own) - p * Math.sin(own), r,
      ...product(turned, [Math.cos(0.5 * own), 0, 0, Math.sin(0.5 * own)]),
    ];
  };
  // Euler's equations under a torque, and the turn of the body, by Runge-Kutta of fourth order: a stage
  // p … z adds to the end of the step, p1 … z1, and leads from its begin, p0 … z0, to the next stage.
  const integrate = ({ moments: [I1, I2, I3] }, [m1, m2, m3], state, since, steps) => {
    let [p0, q0, r0, w0, x0, y0, z0] = state;
    const h = since / steps;
    for (let step = 0; step < steps; step += 1) {
      let p = p0, q = q0, r = r0, w = w0, x = x0, y = y0, z = z0;
      let p1 = p, q1 = q, r1 = r, w1 = w, x1 = x, y1 = y, z1 = z;
      for (let stage = 0; stage < 4; stage += 1) {
        const dp = (m1 + (I2 - I3) * q * r) / I1;
        const dq = (m2 + (I3 - I1) * r * p) / I2;
        const dr = (m3 + (I1 - I2) * p * q) / I3;
        const dw = -0.5 * (p * x + q * y + r * z), dx = 0.5 * (p * w + r * y - q * z);
        const dy = 0.5 * (q * w + p * z - r * x), dz = 0.5 * (r * w + q * x - p * y);
        const part = stage % 3 ? h / 3 : h / 6, ahead = stage < 2 ? h / 2 : h;
        p1 += part * dp; q1 += part * dq; r1 += part * dr;
        w1 += part * dw; x1 += part * dx; y1 += part * dy; z1 += part * dz;
        p = p0 + ahead * dp; q = q0 + ahead * dq; r = r0 + ahead * dr;
        w = w0 + ahead * dw; x = x0 + ahead * dx; y = y0 + ahead * dy; z = z0 + ahead * dz;
      }
      p0 = p1; q0 = q1; r0 = r1; w0 = w1; x0 = x1; y0 = y1; z0 = z1;
    }
    return [p0, q0, r0, w0, x0, y0, z0];
  };
  // Longest step, s. No rate is faster than that of the largest H about the smallest moment, and errors
  // add up along all that is turned: 0.06 rad in a step keeps those of one rad below 2e-7 deg.
  const longest = (body, start, pulses, integrated) => {
    const before = Math.hypot(...inBody(body, start));
    const whole = pulses.reduce((sum, pulse) => sum + Math.hypot(...pulse.impulse), before);
    const rate = whole / Math.min(...body.moments);
    return 0.06 / Math.max(rate * integrated, 1) ** 0.25 / rate;
  };
  const next = new WeakMap(); // by state: what is before the first change is not flown again
  // Rows [t, state] at `times` and where pulses begin and end, two at a jump; the state after the last.
  const fly = (body, start, pulses, times) => {
    const edges = new Set([0, ...times, ...pulses.flatMap((pulse) => [pulse.start, pulse.end])]);
    const over = Math.max(...pulses.map((pulse) => pulse.end));
    const symmetric = body.moments[0] === body.moments[1];
    const on = pulses.reduce((sum, pulse) => sum + pulse.end - pulse.start, 0);
    const step = longest(body, start, pulses, symmetric ? on : Math.max(...edges));
    const rows = [];
    let [now, state, settled] = [0, start, start];
    for (const t of [...edges].sort((one, other) => one - other)) {
      const firing = pulses.filter((pulse) => pulse.start <= now && now < pulse.end && t <= pulse.end);
      const torque = [0, 1, 2].map((part) => firing.reduce((sum, pulse) => sum + pulse.torque[part], 0));
      const key = [t, ...torque, ...body.moments].join();
      if (next.get(state)?.key !== key) {
        const moved = symmetric && !firing.length ? arc(body, state, t - now)
          : integrate(body, torque, state, t - now, Math.ceil((t - now) / step));
        next.set(state, { key, moved });
      }
      state = next.get(state).moved;
      rows.push([t, state]);
      for (const { impulse } of pulses.filter((pulse) => pulse.start === t && pulse.end === t)) {
        const rates = body.moments.map((moment, part) => state[part] + impulse[part] / moment);
        state = [...rates, ...state.slice(3)];
        rows.push([t, state]);
      }
      if (t === over) settled = state;
      now = t;
    }
    return { rows, settled };
  };
  // Angles of one moment, rad: nutation (19), body cone (18) and space cone.
  const cones = (body, state) => {
    const [h1, h2, h3] = inBody(body, state), [p, q, r] = state;
    const nutation = Math.atan2(Math.hypot(h1, h2), body.sense * h3);
    const bodyCone = Math.atan2(Math.hypot(p, q), body.sense * r);
    return { nutation, bodyCone, spaceCone: nutation - bodyCone };
  };
  // Largest nutation of a coast, rad. H turns in the body to where H1 or H2 vanishes; |H| and the energy
  // leave one square of the other. Where only one of both can be, the axis swings to either side of H.
  const widest = (body, state) => {
    const [h1, h2, h3] = inBody(body, state), [I1, I2, I3] = body.moments;
    if (I1 === I2) return cones(body, state).nutation;
    const whole = h1 * h1 + h2 * h2 + h3 * h3, ratio = (1 / I2 - 1 / I3) / (1 / I1 - 1 / I3);
    const squares = [h1 * h1 + ratio * h2 * h2, h2 * h2 + (h1 * h1) / ratio]
      .filter((square) => square >= 0 && square <= whole);
    const side = squares.length > 1 ? Math.sign(body.sense * h3) : -1;
    const angles = squares.map((square) => Math.atan2(Math.sqrt(square), side * Math.sqrt(whole - square)));
    return Math.max(...angles);
  };
  // After the last pulse, rad and rad/s; the axis error is that of H, as for the requirement.
  const residual = (body, start, settled) => {
    const after = momentum(body, settled), shift = angle(momentum(body, start), after);
    const error = body.target ? angle(body.target, after) : shift;
    return { nutation: widest(body, settled), momentum_shift: shift, axis_error: error, spin: settled[2] };
  };
  // A body of another I3 at the same rates. Without an attitude its frame has z along its own H at t = 0.
  const changed = (body, start, factor, framed) => {
    const [I1, I2, I3] = body.moments, other = { ...body, moments: [I1, I2, factor * I3] };
    if (framed || factor === 1) return [other, start];
    const [x, , z] = momentum(other, start), lean = -0.5 * Math.atan2(x, z);
    const turn = product([Math.cos(lean), 0, Math.sin(lean), 0], start.slice(3));
    return [other, [...start.slice(0, 3), ...turn]];
  };
  return { angle, axis, changed, cones, dot, fly, momentum, residual };
})();
