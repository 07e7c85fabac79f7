// The delay that vehicles have had so far, counted as the run's figures count it.

// Seconds that a vehicle alone on the road takes from its start to a station.
coramp.freeTime = (run, i, station) => {
  const road = run.road;
  const share = (way, whole) => (whole > 0 ? way / whole : 1);
  if (!run.on_ramp[i]) {
    return run.free[i] * share(station - road.start_m, road.end_m - road.start_m);
  }
  const toNose = -road.ramp_start_m / road.ramp_mps;
  if (station <= 0) return toNose * share(station - road.ramp_start_m, -road.ramp_start_m);
  const onward = coramp.timeSpeedingUp(road, station);
  return toNose + (run.free[i] - toNose) * share(onward, coramp.timeSpeedingUp(road, road.end_m));
};

// Seconds from the nose to a station beyond it, speeding up evenly to v0.
coramp.timeSpeedingUp = ({ ramp_mps: from, v0_mps: v0, free_accel_mps2: accel }, station) => {
  const reached = Math.min(v0, Math.sqrt(from * from + 2 * accel * station));
  const way = (reached * reached - from * from) / (2 * accel);
  return (reached - from) / accel + (station - way) / v0;
};

// Seconds that one vehicle has lost by a time since it was due; 0 before.
coramp.delayOf = (run, i, time) => {
  if (run.scheduled[i] > time) return 0;
  if (run.exit[i] !== null && run.exit[i] <= time) return run.exit[i] - run.scheduled[i] - run.free[i];
  const waited = time - run.scheduled[i];
  return coramp.isThere(run, i, time)
    ? waited - coramp.freeTime(run, i, coramp.state(run, i, time).station) : waited;
};

// Mean delay in s, by a time, of everyone who was due by then; null before anyone was.
coramp.delaySoFar = (run, time) => {
  let [due, sum] = [0, 0];
  for (let i = 0; i < run.count; i += 1) {
    if (run.scheduled[i] > time) continue;
    due += 1;
    sum += coramp.delayOf(run, i, time);
  }
  return due ? sum / due : null;
};
