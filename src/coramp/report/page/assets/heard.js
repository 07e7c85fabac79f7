// What the coordinator knew of vehicles, and which messages were lost: from the records of the run.
coramp.FALLBACK = 1; coramp.UNKNOWN = 2; coramp.REPORT_LOST = 4; coramp.COMMAND_LOST = 8;
coramp.KNOWN_ON_MAINLINE = 16; coramp.HEARD_COLUMNS = 4;
coramp.OLD_S = 0.25; coramp.WRONG_M = 0.5;
coramp.BREAKS_DOWN = 'vehicle breaks down';

// What is known of a vehicle at a time: null where it is known as it is, and nothing is lost.
// ``station`` is where it is taken to be, from ``low`` to ``high`` where it may be by then.
coramp.known = (run, i, time) => {
  const { heard } = run;
  if (!heard) return null;
  let [low, high] = [heard.first[i], heard.first[i + 1] - 1];
  if (high < low || heard.rows[low * coramp.HEARD_COLUMNS] > time) return null;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (heard.rows[middle * coramp.HEARD_COLUMNS] <= time) low = middle; else high = middle - 1;
  }
  const at = low * coramp.HEARD_COLUMNS;
  const [, error, age, bits] = heard.rows.slice(at, at + coramp.HEARD_COLUMNS);
  if (bits === 0 && error === 0) return null;
  const { station, speed } = coramp.state(run, i, time);
  const off = 2 * heard.noise_m;
  return { error, age, fallback: (bits & coramp.FALLBACK) > 0, unknown: (bits & coramp.UNKNOWN) > 0,
    reportLost: (bits & coramp.REPORT_LOST) > 0, commandLost: (bits & coramp.COMMAND_LOST) > 0,
    onMainline: (bits & coramp.KNOWN_ON_MAINLINE) > 0, station: station + error,
    low: station + error - off - Math.min(speed * age, 0.5 * heard.brakes_mps2 * age * age),
    high: station + error + off + 0.5 * heard.speeds_up_mps2 * age * age };
};

// Whether what is known is so old or wrong that it is drawn.
coramp.isOff = (known) => known !== null && !known.unknown
  && (known.age > coramp.OLD_S || Math.abs(known.error) > coramp.WRONG_M);

// From when to when a vehicle fell back, or was not known; pairs of times in s.
coramp.spansOf = (run, i, bit) => {
  const { heard } = run;
  const spans = [];
  if (!heard) return spans;
  let from = null;
  for (let k = heard.first[i]; k < heard.first[i + 1]; k += 1) {
    const at = k * coramp.HEARD_COLUMNS;
    const is = (heard.rows[at + 3] & bit) > 0;
    if (is && from === null) from = heard.rows[at];
    if (!is && from !== null) { spans.push([from, heard.rows[at]]); from = null; }
  }
  return spans;
};

// Every fallback and every time in which a vehicle was not known, by when it begins.
coramp.lapses = (run) => {
  if (!run.heard) return [];
  run.lapsesFound ??= run.everyone.flatMap((vehicle) => [coramp.FALLBACK, coramp.UNKNOWN].flatMap(
    (bit) => coramp.spansOf(run, vehicle, bit).map(([from, to]) => ({ vehicle, bit, from, to }))))
    .sort((a, b) => a.from - b.from);
  return run.lapsesFound;
};

coramp.lapseText = (run, { bit, from, to }) => {
  const lasts = `for ${(to - from).toFixed(1)} s`;
  return bit === coramp.FALLBACK ? `drives by itself ${lasts}: its last command had expired (fallback)`
    : `is not known to the coordinator ${lasts}: no report of it, or none newer than ${run.heard.stale_s} s`;
};

// What a vehicle does at a time and why, where that was kept.
coramp.actAt = (run, i, time) => (run.acts?.[run.ids[i]] ?? [])
  .filter(([from, to]) => from <= time && time < to).map(([, , text]) => text);

// When the vehicle that broke down drives on, in s; other events have no end.
coramp.eventEnd = (run, { what, time, vehicle }) => {
  if (what !== coramp.BREAKS_DOWN) return time;
  let stood = false;
  for (let at = time; at < coramp.exit(run, vehicle); at += 0.2) {
    const { speed } = coramp.state(run, vehicle, at);
    if (stood && speed > 0.5) return at;
    stood = stood || speed < 0.5;
  }
  return coramp.exit(run, vehicle);
};

// The vehicles that have broken down at a time.
coramp.brokenDown = (run, time) => new Set((run.events ?? [])
  .filter((e) => e.what === coramp.BREAKS_DOWN && e.time <= time && time < (e.end ??= coramp.eventEnd(run, e)))
  .map((e) => e.vehicle));

// What is off at a time, in words for the line below the picture.
coramp.knownTold = (run, lanes, time) => {
  if (!run.heard) return [];
  const all = [...lanes.mainline, ...lanes.ramp].map(({ i }) => [i, coramp.known(run, i, time)])
    .filter(([, known]) => known !== null);
  const count = (key) => all.filter(([, known]) => known[key]).length;
  const told = [];
  const lost = [['reportLost', 'report'], ['commandLost', 'command']].filter(([key]) => count(key))
    .map(([key, what]) => `${count(key)} ${what}${count(key) > 1 ? 's' : ''}`);
  if (lost.length) told.push(`lost just now: ${lost.join(', ')}`);
  if (count('fallback')) told.push(`${count('fallback')} in fallback`);
  if (count('unknown')) told.push(`${count('unknown')} not known to the coordinator`);
  const off = all.filter(([, known]) => coramp.isOff(known));
  if (off.length) {
    const [i, worst] = off.reduce((a, b) => (Math.abs(b[1].error) > Math.abs(a[1].error) ? b : a));
    told.push(`coordinator off by up to ${Math.abs(worst.error).toFixed(1)} m (${run.ids[i]}, heard `
      + `${worst.age.toFixed(1)} s ago)`);
  }
  return told;
};

// What is known of one vehicle, in words; nothing where all is known.
coramp.knownOf = (run, i, time) => {
  const known = coramp.known(run, i, time);
  const told = coramp.actAt(run, i, time);
  if (known === null) return told;
  if (known.unknown) told.push('not known to the coordinator');
  else if (coramp.isOff(known)) {
    const side = known.error > 0 ? 'ahead of' : 'behind';
    const off = Math.abs(known.error) < 0.05 ? 'where it is' : `${Math.abs(known.error).toFixed(1)} m ${side} where it is`;
    told.push(`heard ${known.age.toFixed(1)} s ago, taken to be ${off}`);
  }
  if (known.reportLost) told.push('its report is lost');
  if (known.commandLost) told.push('its command is lost');
  if (known.fallback) told.push('in fallback: its last command has expired');
  return told;
};

// Where the coordinator takes a vehicle to be: a dashed outline, with an arrow from the vehicle where
// both are apart, and below it a bar over where it may be by then.
coramp.drawKnown = (ctx, road, row, vehicle, known) => {
  const { run } = road;
  const high = coramp.Road.BODY * road.lane;
  const y = road.y(row, known.station, known.onMainline);
  const [x, low, far, own] = [known.station, known.low, known.high, vehicle.station].map((m) => road.x(row, m));
  const long = run.length[vehicle.i] * road.scale;
  ctx.save();
  ctx.strokeStyle = coramp.colour('ghost');
  ctx.lineWidth = 1.6;
  ctx.setLineDash([3, 2]);
  ctx.strokeRect(x - long, y - 0.5 * high - 2, long, high + 4);
  ctx.setLineDash([]);
  if (Math.abs(x - own) > long + 5) coramp.arrow(ctx, x > own ? [own, x - long] : [own - long, x], y);
  const bar = y + 0.5 * high + 2.5 + 2.5 * (vehicle.i % 2);
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(low, bar);
  ctx.lineTo(far, bar);
  for (const end of [low, far]) { ctx.moveTo(end, bar - 2.5); ctx.lineTo(end, bar + 2.5); }
  ctx.stroke();
  ctx.restore();
};

// An arrow between two places of a row.
coramp.arrow = (ctx, [from, to], y) => {
  const way = Math.sign(to - from);
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(from, y);
  ctx.lineTo(to, y);
  ctx.moveTo(to - 4 * way, y - 3);
  ctx.lineTo(to, y);
  ctx.lineTo(to - 4 * way, y + 3);
  ctx.stroke();
};

// Signs above a vehicle: broken down, in fallback, not known, messages just lost.
coramp.drawSigns = (ctx, road, row, vehicle, onMainline, known, broken) => {
  const signs = [];
  if (broken) signs.push(['broken', '!']);
  if (known?.fallback) signs.push(['fallback', 'F']);
  if (known?.unknown) signs.push(['ghost', '?']);
  else if (known?.reportLost) signs.push(['lost-report', '×']);
  if (known?.commandLost) signs.push(['lost-command', '×']);
  const middle = road.x(row, vehicle.station - 0.5 * road.run.length[vehicle.i]);
  const y = road.y(row, vehicle.station, onMainline) - 0.5 * road.lane - 1;
  ctx.save();
  ctx.font = '700 9px system-ui, sans-serif';
  ctx.textAlign = 'center';
  ctx.textBaseline = 'middle';
  signs.forEach(([kind, text], k) => {
    const x = middle + (k - 0.5 * (signs.length - 1)) * 11;
    const small = text === '×';
    ctx.fillStyle = coramp.colour(kind);
    if (!small) {
      ctx.beginPath();
      if (kind === 'broken') { ctx.moveTo(x, y - 7); ctx.lineTo(x + 7, y + 5); ctx.lineTo(x - 7, y + 5); ctx.closePath(); }
      else ctx.roundRect(x - 5, y - 5, 10, 10, 3);
      ctx.fill();
      ctx.fillStyle = coramp.colour('page');
    } else ctx.font = '800 12px system-ui, sans-serif';
    ctx.fillText(text, x, y + 0.5);
    ctx.font = '700 9px system-ui, sans-serif';
  });
  ctx.restore();
};
