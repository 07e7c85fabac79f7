// Where vehicles are: the records' pieces of constant acceleration, evaluated at any time.
const coramp = {};

coramp.TIME = 0; coramp.STATION = 1; coramp.SPEED = 2; coramp.ACCEL = 3; coramp.COLUMNS = 4;

// A run as the page uses it: typed arrays, and look-ups by vehicle.
coramp.runOf = (data) => {
  const run = { ...data, pieces: Float64Array.from(data.pieces), count: data.ids.length };
  run.indexOf = new Map(data.ids.map((id, i) => [id, i]));
  run.decisionsOf = new Map();
  run.movedFor = new Map();
  data.decisions.forEach((decision) => {
    coramp.append(run.decisionsOf, decision.vehicle, decision);
    decision.adjusted.forEach((i) => coramp.append(run.movedFor, i, decision));
  });
  run.violating = new Map();
  data.violations.forEach((violation) => {
    coramp.append(run.violating, violation.front, violation);
    coramp.append(run.violating, violation.rear, violation);
  });
  run.everyone = [...data.ids.keys()].filter((i) => data.first[i + 1] > data.first[i]);
  run.everyone.sort((a, b) => coramp.entry(run, a) - coramp.entry(run, b));
  return run;
};

coramp.append = (map, key, value) => {
  if (map.has(key)) map.get(key).push(value); else map.set(key, [value]);
};

coramp.entry = (run, i) => run.pieces[run.first[i] * coramp.COLUMNS];
coramp.exit = (run, i) => run.exit[i] ?? run.end_s;
coramp.isThere = (run, i, time) =>
  run.first[i + 1] > run.first[i] && coramp.entry(run, i) <= time && time <= coramp.exit(run, i);
coramp.onMainline = (run, i, time) =>
  !run.on_ramp[i] || (run.merge[i] !== null && time >= run.merge[i]);

// Station (m), speed (m/s) and acceleration (m/s2) of a vehicle that is there.
coramp.state = (run, i, time) => {
  let low = run.first[i];
  let high = run.first[i + 1] - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (run.pieces[middle * coramp.COLUMNS] <= time) low = middle; else high = middle - 1;
  }
  const at = low * coramp.COLUMNS;
  const x = time - run.pieces[at];
  const accel = run.pieces[at + coramp.ACCEL];
  const speed = run.pieces[at + coramp.SPEED];
  return {
    station: run.pieces[at + coramp.STATION] + (speed + 0.5 * accel * x) * x,
    speed: speed + accel * x,
    accel,
  };
};

// All vehicles of the road at a time, in lane order, front first.
coramp.situation = (run, time) => {
  const lanes = { mainline: [], ramp: [] };
  for (const i of run.everyone) {
    if (coramp.entry(run, i) > time) break;
    if (coramp.exit(run, i) < time) continue;
    const state = coramp.state(run, i, time);
    lanes[coramp.onMainline(run, i, time) ? 'mainline' : 'ramp'].push({ i, ...state });
  }
  Object.values(lanes).forEach((lane) => {
    lane.sort((a, b) => b.station - a.station);
    lane.forEach((vehicle, place) => {
      const front = lane[place - 1];
      vehicle.gap = front ? front.station - run.length[front.i] - vehicle.station : null;
      vehicle.needed = front ? coramp.safeDistance(run, front, vehicle) : null;
    });
  });
  return lanes;
};

// L_safe = 2 L_1 + L_2 + L_3 (Eq. 1 to 3) of a pair, with each vehicle's own errors and the
// follower's time gap, and the standstill gap of the scenario; in m.
coramp.safeDistance = (run, front, rear) => {
  const s = run.safety;
  const closing = 3.6 * Math.max(0, rear.speed - front.speed);
  return run.position_error[front.i] + run.position_error[rear.i]
    + run.clock_error[front.i] * front.speed + run.clock_error[rear.i] * rear.speed
    + (closing * closing) / (254 * (s.adhesion + s.resistance))
    + run.time_gap[rear.i] * rear.speed + s.standstill_gap_m;
};

// How many are due but still outside.
coramp.waiting = (run, time) => {
  let waiting = 0;
  for (let i = 0; i < run.count; i += 1) {
    const entered = run.first[i + 1] > run.first[i] && coramp.entry(run, i) <= time;
    if (run.scheduled[i] <= time && !entered) waiting += 1;
  }
  return waiting;
};

// Points (time, station) of a vehicle's line in a diagram.
coramp.line = (run, i) => {
  const points = [];
  const end = coramp.exit(run, i);
  for (let k = run.first[i]; k < run.first[i + 1]; k += 1) {
    const at = k * coramp.COLUMNS;
    const [t, s, v, a] = run.pieces.subarray(at, at + coramp.COLUMNS);
    const next = k + 1 < run.first[i + 1] ? Math.min(end, run.pieces[at + coramp.COLUMNS]) : end;
    const steps = a === 0 ? 1 : Math.max(1, Math.ceil((next - t) / 0.5));
    for (let step = 0; step < steps; step += 1) {
      const x = ((next - t) * step) / steps;
      points.push([t + x, s + (v + 0.5 * a * x) * x]);
    }
    if (next >= end) {
      const x = Math.max(0, end - t);
      points.push([end, s + (v + 0.5 * a * x) * x]);
      break;
    }
  }
  return points;
};

// What each role is drawn in; the style sheet has the colours, for light and for dark.
coramp.role = (run, i) => {
  if (run.automated) return run.automated[i] ? 'automated' : 'driver';
  if (run.on_ramp[i]) return 'ramp';
  return run.movedFor.has(i) ? 'moved' : 'mainline';
};

coramp.colours = new Map();
coramp.colour = (name) => {
  if (!coramp.colours.has(name)) {
    const style = getComputedStyle(document.documentElement);
    coramp.colours.set(name, style.getPropertyValue(`--${name}`).trim());
  }
  return coramp.colours.get(name);
};
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => coramp.colours.clear());

coramp.element = (tag, attributes = {}, ...children) => {
  const element = document.createElement(tag);
  Object.entries(attributes).forEach(([name, value]) => {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (value !== false && value !== null) element.setAttribute(name, value === true ? '' : value);
  });
  element.append(...children.filter((child) => child !== null));
  return element;
};

// Data that lie in the page: base64 of gzipped JSON.
coramp.data = (element) => {
  const bytes = Uint8Array.from(atob(element.textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Response(stream).json();
};

// A run that lies in the page, unpacked when it is first shown.
coramp.unpacked = async (element) => coramp.runOf(await coramp.data(element));

coramp.number = (value, digits = 2) => (value === null ? '–' : value.toFixed(digits));
