// What is known of one vehicle: its decisions with the equations' numbers, and who it moved for.
coramp.KEY_EQUATIONS = ['1', '17', '18', '26', '28', '31', '36'];

coramp.story = (run, i, time) => {
  const lines = [];
  const scheduled = run.scheduled[i];
  lines.push(`${scheduled.toFixed(1)} s: due at the zone's start`);
  const events = [
    ...(run.decisionsOf.get(i) ?? []).map((d) => [d.time, d.told]),
    ...(run.movedFor.get(i) ?? []).map((d) => [d.time, `moves for ${run.ids[d.vehicle]}`]),
    ...(run.violating.get(i) ?? []).map((v) => [v.time, coramp.violationText(run, v)]),
    ...coramp.lapses(run).filter((lapse) => lapse.vehicle === i && !(run.acts && lapse.bit === coramp.FALLBACK)).map((lapse) => [lapse.from, coramp.lapseText(run, lapse)]),
    ...(run.events ?? []).filter((e) => e.vehicle === i).map((e) => [e.time, e.what]),
    ...(run.acts?.[run.ids[i]] ?? []).map(([from, , text]) => [from, text]),
  ];
  if (run.first[i + 1] > run.first[i]) {
    events.push([coramp.entry(run, i), 'enters']);
    if (run.on_ramp[i] && run.merge[i] !== null) events.push([run.merge[i], 'changes to the mainline']);
    if (run.exit[i] !== null) events.push([run.exit[i], 'leaves']);
  }
  events.sort((a, b) => a[0] - b[0]);
  events.forEach(([at, text]) => lines.push(`${at.toFixed(1)} s: ${text}`));
  if (time !== undefined && coramp.isThere(run, i, time)) {
    const state = coramp.state(run, i, time);
    lines.push(`at ${time.toFixed(1)} s: station ${state.station.toFixed(1)} m, `
      + `${state.speed.toFixed(2)} m/s, ${state.accel.toFixed(2)} m/s²`);
  }
  return lines;
};

coramp.violationText = (run, v) =>
  `too near: ${run.ids[v.rear]} behind ${run.ids[v.front]}, ${(-v.margin).toFixed(3)} m less than `
  + 'the safe distance';

coramp.equationLabel = (equation) => (equation ? `Eq. ${equation}` : '');

// The few quantities that a tooltip has room for.
coramp.keyQuantities = (run, decision) =>
  decision.quantities
    .map(([template, value]) => [...run.templates[template], value])
    .filter(([equation]) => coramp.KEY_EQUATIONS.includes(equation))
    .map(([equation, symbol, , value]) => `${coramp.equationLabel(equation)}: ${symbol} = ${value}`);

// The decision that matters most of a vehicle: its merge, or else its last, or one that moved it.
coramp.mainDecision = (run, i) => {
  const own = run.decisionsOf.get(i) ?? [];
  return own.findLast((d) => d.rung !== 'hold') ?? own.at(-1) ?? run.movedFor.get(i)?.at(-1) ?? null;
};

// What was tried for a decision, line by line, from the records of the run.
coramp.triedOf = (run, decision) => {
  const { element } = coramp;
  const who = `${run.ids[decision.vehicle]} at ${decision.time.toFixed(1)} s`;
  return element('details', { class: 'tried' },
    element('summary', {}, `What was tried for ${who}, and why it was refused`),
    element('ul', {}, ...decision.tried.map((line) => element('li', {}, line))));
};

coramp.detailsOf = (run, i) => {
  const { element } = coramp;
  const box = element('div', { class: 'details' });
  const stream = run.on_ramp[i] ? 'ramp' : 'mainline';
  box.append(element('h4', {}, [run.ids[i], stream, ...(run.automated ? [coramp.role(run, i)] : []), run.title].join(', ')));
  const list = element('ul', { class: 'story' });
  coramp.story(run, i).forEach((line) => list.append(element('li', {}, line)));
  box.append(list);
  const decision = coramp.mainDecision(run, i);
  if (decision === null) return box;
  box.append(coramp.triedOf(run, decision));
  const who = run.ids[decision.vehicle];
  const caption = `Decision for ${who} at ${decision.time.toFixed(1)} s, rung ${decision.rung}: `
    + 'every quantity behind it, with its equation in the paper';
  const rows = decision.quantities.map(([template, value]) => {
    const [equation, symbol, meaning] = run.templates[template];
    return element('tr', {}, element('td', {}, coramp.equationLabel(equation)),
      element('td', {}, symbol), element('td', {}, meaning), element('td', { class: 'number' }, value));
  });
  const head = element('tr', {}, ...['equation', 'symbol', 'what', 'value']
    .map((text) => element('th', { scope: 'col' }, text)));
  box.append(element('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': caption },
    element('table', {}, element('caption', {}, caption), element('thead', {}, head),
      element('tbody', {}, ...rows))));
  return box;
};
