// Puts runs into the page: replay, diagrams and details that follow each other.
coramp.Show = class {
  constructor(box, runs, before = null) {
    this.box = box;
    this.runs = runs;
    box.replaceChildren();
    const { element } = coramp;
    const replayBox = element('div');
    this.details = element('div', { class: 'detail-box', 'aria-live': 'polite' },
      element('p', { class: 'hint' }, 'Point at a vehicle, or choose one, to see its decision.'));
    const heading = document.querySelector('h2') ? 'h3' : 'h2';
    box.append(replayBox, this.details, element(heading, {}, 'Time-space diagram'), coramp.legend(runs));
    this.diagrams = runs.map((run) => {
      const diagramBox = element('figure', {}, element('figcaption', {}, run.title));
      box.append(diagramBox);
      return new coramp.Diagram(run, diagramBox, {
        onselect: (i) => this.select(run, i),
        ontime: (time) => { this.replay.pause(); this.replay.seek(time); },
      });
    });
    this.replay = new coramp.Replay(runs, replayBox, {
      ontime: (time) => this.diagrams.forEach((diagram) => diagram.setTime(time)),
      onselect: (run, i) => this.diagrams[runs.indexOf(run)].select(i),
    }, before?.replay ?? null);
    box.append(this.replay.bar);
    this.diagrams.forEach((diagram) => {
      const { x, y } = before?.window ?? {};
      if (before) diagram.show([x[0], Math.min(x[1], diagram.full.x[1])], y);
      else diagram.showAround(this.replay.time);
    });
  }

  // How it is looked at, so that other runs can be looked at in the same way.
  state() {
    const { x, y } = this.diagrams[0].plot.scales;
    const { full } = this.diagrams[0];
    const whole = x.min <= full.x[0] && x.max >= full.x[1];
    return {
      window: { x: [x.min, whole ? Infinity : x.max], y: [y.min, y.max] },
      replay: this.replay.state(),
    };
  }

  select(run, i) {
    this.replay.selected = i === null ? null : run.ids[i];
    this.replay.draw();
    const shown = i === null ? [] : this.runs
      .filter((other) => other.indexOf.has(run.ids[i]))
      .map((other) => coramp.detailsOf(other, other.indexOf.get(run.ids[i])));
    this.details.replaceChildren(...shown);
  }
};

// What lines are drawn in; kinds of vehicles where drivers and automated vehicles mix.
coramp.legend = (runs) => {
  const { element } = coramp;
  const kinds = { automated: 'automated vehicle', driver: 'driver',
    ramp: `${runs.every((run) => run.automated) ? 'dot' : 'ramp vehicle, dot'}: merge of a ramp vehicle` };
  const roles = { ramp: 'ramp vehicle, dot: its merge', moved: 'moves for another', mainline: 'mainline vehicle' };
  const entries = { ...(runs.every((run) => run.automated) ? {} : roles), ...(runs.some((run) => run.automated) ? kinds : {}),
    ...(runs.some((run) => run.heard) ? { fallback: 'in fallback', unknown: 'gaps in a line: not known to the coordinator' } : {}),
    ...(runs.some((run) => run.events?.some((e) => e.what === coramp.BREAKS_DOWN)) ? { broken: 'broken down' } : {}),
    lane: 'stations of the acceleration lane', bad: 'nearer than the safe distance', upright: 'time of the replay' };
  return element('ul', { class: 'legend' }, ...Object.entries(entries).map(([key, text]) =>
    element('li', {}, element('span', { class: `swatch ${key}`, 'aria-hidden': 'true' }), text)));
};

coramp.problem = (box, error) => {
  box.replaceChildren(coramp.element('p', { role: 'alert', class: 'problem' },
    `This cannot be shown: ${error.message}`));
};
