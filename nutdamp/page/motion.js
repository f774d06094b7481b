// Motion of a symmetric body by impulses, as `nutdamp.flight.propagation.by_impulses`: pure functions, SI and rad, in
// principal axes; numbers of equations: Magnus 1970. Complex numbers are [re, im], quaternions [w, x, y, z] lead from
// the body to inertial space. A body is {A, C, target, sense}, a state {omega, spin, turn}, a pulse {t, on, impulse, push}.
const motion = (() => {
  const dot = (u, v) => u.reduce((sum, x, index) => sum + x * v[index], 0);
  const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
  const angle = (u, v) => Math.atan2(Math.hypot(...cross(u, v)), dot(u, v));
  const times = ([a, b], [c, d]) => [a * c - b * d, a * d + b * c];
  const phase = (angle) => [Math.cos(angle), Math.sin(angle)];
  const product = ([p, a, b, c], [w, x, y, z]) => [
    p * w - a * x - b * y - c * z, p * x + a * w + b * z - c * y, p * y - a * z + b * w + c * x, p * z + a * y - b * x + c * w,
  ];
  const rotate = ([w, ...v], u) => {
    const twice = cross(v, u).map((x) => 2 * x);
    return cross(v, twice).map((x, index) => u[index] + w * twice[index] + x);
  };
  // (4): inertia ratio.
  const ratio = ({ A, C }) => (A - C) / A;
  const bodyMomentum = ({ A, C }, { omega, spin }) => [A * omega[0], A * omega[1], C * spin];
  const momentum = (body, state) => rotate(state.turn, bodyMomentum(body, state));
  const axis = (body, state) => rotate(state.turn, [0, 0, body.sense]);
  // Free motion of `since` s: ω turns by −aω3 (12); the body turns about H by |H|/A and about its axis by aω3 (fig. 4).
  const arc = (body, state, since) => {
    const angularMomentum = bodyMomentum(body, state), size = Math.hypot(...angularMomentum);
    const [about, own] = [0.5 * (size / body.A) * since, 0.5 * ratio(body) * state.spin * since];
    const sine = size > 0 ? Math.sin(about) / size : 0;
    const turned = product(state.turn, [Math.cos(about), ...angularMomentum.map((h) => sine * h)]);
    return {
      omega: times(state.omega, phase(-ratio(body) * state.spin * since)),
      spin: state.spin,
      turn: product(turned, [Math.cos(own), 0, 0, Math.sin(own)]),
    };
  };
  // Gauss-Legendre, five points: nodes and weights.
  const [inner, outer] = [-1, 1].map((sign) => Math.sqrt(5 + 2 * sign * Math.sqrt(10 / 7)) / 3);
  const [more, less] = [1, -1].map((sign) => (322 + 13 * sign * Math.sqrt(70)) / 900);
  const GAUSS = [[0, 128 / 225], [inner, more], [-inner, more], [outer, less], [-outer, less]];
  // Mean of exp(i a ∫ω3) over a pulse about its centre: sinc(aω3 τ/2); with an axial torque ω3 grows by `rate` along it.
  const widthFactor = (a, spin, rate, on) => {
    const half = 0.5 * on, turned = 0.5 * a * spin * on;
    if (rate === 0) return [turned === 0 ? 1 : Math.sin(turned) / turned, 0];
    const panels = Math.ceil((Math.abs(a) * (Math.abs(spin) + Math.abs(rate) * on) * half) / 0.25) || 1;
    const wide = half / panels, sum = [0, 0];
    for (let panel = 0; panel < panels; panel += 1) {
      for (const [node, weight] of GAUSS) {
        const s = (2 * panel + 1 - panels + node) * wide;
        const [re, im] = phase(a * (spin * s + 0.5 * rate * (s + half) ** 2));
        sum[0] += (weight * re) / (2 * panels);
        sum[1] += (weight * im) / (2 * panels);
      }
    }
    return sum;
  };
  // (17): a pulse adds its impulse, shortened by its width, to A ω and to C ω3 at its centre.
  const kick = (body, state, { on, impulse, push }) => {
    const factor = widthFactor(ratio(body), state.spin, push / body.C, on);
    const [j1, j2] = times(impulse, factor);
    const omega = [state.omega[0] + j1 / body.A, state.omega[1] + j2 / body.A];
    return { ...state, omega, spin: state.spin + impulse[2] / body.C };
  };
  // Arcs of (17), each from `start` s on, in order: the first is that before all pulses.
  const fly = (body, start, pulses) => {
    const arcs = [{ start: 0, state: start }];
    for (const pulse of [...pulses].sort((one, other) => one.t - other.t)) {
      const before = arcs[arcs.length - 1];
      arcs.push({ start: pulse.t, state: kick(body, arc(body, before.state, pulse.t - before.start), pulse) });
    }
    return arcs;
  };
  // Nutation (19), body cone (18) and space cone, rad.
  const cones = (body, { omega, spin }) => {
    const across = Math.hypot(...omega), along = body.sense * spin;
    const nutation = Math.atan2(body.A * across, body.C * along), bodyCone = Math.atan2(across, along);
    return { nutation, bodyCone, spaceCone: nutation - bodyCone };
  };
  // After the last pulse, rad and rad/s; the axis error is that of H, as for the requirement.
  const residual = (body, arcs) => {
    const left = arcs[arcs.length - 1].state;
    const [before, after] = [momentum(body, arcs[0].state), momentum(body, left)];
    const shift = angle(before, after);
    return {
      nutation: cones(body, left).nutation,
      momentum_shift: shift,
      axis_error: body.target ? angle(body.target, after) : shift,
      spin: left.spin,
    };
  };
  // A body of another C at the same rates: where z of the frame is H at t = 0, the body leans in it by another nutation.
  const changed = (body, start, factor, framed) => {
    const other = { ...body, C: body.C * factor };
    const lean = 0.5 * (cones(other, start).nutation - cones(body, start).nutation);
    return [other, framed ? start : { ...start, turn: product([Math.cos(lean), 0, Math.sin(lean), 0], start.turn) }];
  };
  return { angle, arc, axis, changed, cones, dot, fly, momentum, residual };
})();
