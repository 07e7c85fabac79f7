// The studio: what is set goes into the address; the server computes it; the picture follows.
coramp.Studio = class {
  constructor(form) {
    this.form = form;
    this.controls = new Map();
    form.querySelectorAll('[data-number], [data-choice]').forEach((control) => {
      this.controls.set(control.dataset.number ?? control.dataset.choice, control);
    });
    this.first = this.values();
    this.replaced = {};
    this.read(new URLSearchParams(location.search));
    form.addEventListener('input', (event) => this.changed(event.target));
    form.addEventListener('submit', (event) => event.preventDefault());
    document.getElementById('reset').addEventListener('click', () => this.reset());
    addEventListener('popstate', () => {
      this.set(this.first);
      this.read(new URLSearchParams(location.search));
      this.compute();
    });
    this.compute();
  }

  values() {
    return Object.fromEntries([...this.controls].map(([name, control]) => [name, control.value]));
  }

  set(values) {
    Object.entries(values).forEach(([name, value]) => {
      this.controls.get(name).value = value;
      const slider = this.form.querySelector(`[data-slider="${name}"]`);
      if (slider) slider.value = value;
    });
  }

  // What the address says; what it says wrongly is told by the server.
  read(address) {
    const known = [...address].filter(([name]) => this.controls.has(name));
    this.set(Object.fromEntries(known));
    const folded = document.getElementById('folded');
    if (known.some(([name]) => folded.contains(this.controls.get(name)))) folded.open = true;
    this.strange = [...address].filter(([name]) => !this.controls.has(name));
    known.forEach(([name, value]) => {
      if (this.controls.get(name).value !== value) this.strange.push([name, value]);
    });
    this.replaced = {};
    const told = new Set(known.map(([name]) => name));
    for (const choice of ['strategy', 'second']) if (!told.has(choice)) this.followWorld(choice);
    this.sayFollowed();
  }

  changed(control) {
    const name = control.dataset.slider ?? control.dataset.number;
    if (control.dataset.slider) this.controls.get(name).value = control.value;
    const slider = this.form.querySelector(`[data-slider="${name}"]`);
    if (control.dataset.number && slider) slider.value = control.value;
    this.strange = [];
    this.follow(name ?? control.dataset.choice);
    this.compute();
  }

  // Whether the world has drivers or faults, and so only SUMO has it.
  isMixed({ share, preset } = this.values()) { return Number(share) < 100 || preset !== 'none'; }

  runsAmongDrivers(name) {
    const option = [...this.controls.get(name).options].find((found) => found.selected);
    return option === undefined || option.value === 'nothing' || 'among' in option.dataset;
  }

  // What moves along with a dial of the world: a strategy that cannot run there gives way to one that
  // can, and comes back with the world; drivers beside it are of the same population.
  follow(name) {
    const { drivers, second } = this.values();
    if (name === 'strategy' || name === 'second') delete this.replaced[name];
    if (name === 'drivers' && second.startsWith('uncontrolled:')) this.set({ second: `uncontrolled:${drivers}` });
    if (name === 'share' || name === 'preset') {
      for (const choice of ['strategy', 'second']) this.followWorld(choice);
    }
    this.sayFollowed();
  }

  followWorld(choice) {
    const instead = choice === 'strategy' ? 'mixed-slots' : 'nothing';
    if (this.isMixed()) {
      if (this.runsAmongDrivers(choice)) return;
      this.replaced[choice] = this.values()[choice];
      this.set({ [choice]: instead });
    } else if (choice in this.replaced) {
      this.set({ [choice]: this.replaced[choice] });
      delete this.replaced[choice];
    }
  }

  sayFollowed() {
    const { share, strategy } = this.values();
    const shown = (choice, value) => [...this.controls.get(choice).options].find((found) => found.value === value).text;
    const lines = Object.entries(this.replaced).map(([choice, value]) =>
      `${shown(choice, value)} cannot run in this world; ${shown(choice, this.values()[choice])} is shown instead.`);
    if (Number(share) === 0 && ['mixed-slots', 'automation'].includes(strategy)) {
      lines.push('At 0 % nobody is automated, so that drivers alone are shown.');
    }
    document.getElementById('switched').textContent = lines.join(' ');
  }

  reset() {
    this.strange = [];
    this.replaced = {};
    this.set(this.first);
    this.sayFollowed();
    this.compute();
  }

  // What differs from where it started, and so is in the address.
  asked() {
    // Where only some strategies can run, the address names the one that is chosen.
    const values = this.values();
    const elsewhere = this.isMixed(values) && !this.isMixed(this.first);
    const named = elsewhere || values.drivers !== this.first.drivers ? ['strategy', 'second'] : [];
    const differing = Object.entries(values).filter(([name, value]) => value !== this.first[name] || named.includes(name));
    return new URLSearchParams([...Object.entries(Object.fromEntries([...differing, ...this.strange]))]);
  }

  compute() {
    this.wanted = `${this.asked()}`;
    history.replaceState(null, '', this.wanted ? `?${this.wanted}` : location.pathname);
    document.getElementById('save').href = `scenario.toml?${this.wanted}`;
    document.getElementById('link').href = location.href;
    this.asking?.abort();
    if (!this.busy) coramp.ready = this.work();
  }

  // One question at a time; what was set meanwhile is asked next, what lies between is left out. A
  // question that SUMO works on is dropped, which ends its run; the next one waits for the slider.
  async work() {
    this.busy = true;
    const status = document.getElementById('status');
    const results = document.getElementById('results');
    while (this.wanted !== null) {
      const asked = this.wanted;
      this.wanted = null;
      const first = coramp.shown === undefined && this.values().second !== 'nothing' && !this.isMixed();
      const started = performance.now();
      const slow = setTimeout(() => {
        this.takesLong = true;
        status.textContent = 'computing …';
        results.classList.add('outdated');
      }, 300);
      try {
        // The first picture does not wait for the drivers beside it.
        if (first) this.show(await this.told(this.alone(asked)));
        const told = await this.told(asked);
        this.show(told);
        this.took_ms = performance.now() - started;
        status.textContent = told.errors ? '' : `computed and drawn in ${this.took_ms.toFixed(0)} ms`;
      } catch (error) {
        if (error.name === 'AbortError') {
          await this.atRest();
        } else {
          const gone = error instanceof TypeError ? 'the studio does not answer; is it still running?' : error.message;
          this.tell([gone]);
          status.textContent = '';
        }
      } finally {
        clearTimeout(slow);
        this.takesLong = false;
        if (this.wanted === null) results.classList.remove('outdated');
        this.progress([]);
      }
    }
    this.busy = false;
  }

  // Until nothing was set for a moment.
  async atRest() {
    let asked;
    do {
      asked = this.wanted;
      await new Promise((done) => { setTimeout(done, 200); });
    } while (asked !== this.wanted);
  }

  // The answer is the last line; those before it tell how far SUMO is, and from then on the question
  // may be dropped.
  async told(asked) {
    const asking = new AbortController();
    try {
      const response = await fetch(`runs?${asked}`, { signal: asking.signal });
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = '';
      let last = '';
      for (;;) {
        const { value, done } = await reader.read();
        if (done) return JSON.parse(last);
        const lines = (rest + value).split('\n');
        rest = lines.pop();
        last = lines.at(-1) ?? last;
        if (last.startsWith('{"progress"')) {
          this.asking = asking;
          if (this.wanted !== null) asking.abort();
          this.progress(JSON.parse(last).progress);
        }
      }
    } finally {
      this.asking = null;
    }
  }

  progress(runs) {
    const { element } = coramp;
    const list = document.getElementById('progress');
    list.hidden = runs.length === 0 || !this.takesLong;
    list.replaceChildren(...runs.map(({ title, told, share }) => element('li', {},
      element('span', {}, title), element('progress', { max: 1, value: share, 'aria-label': title }), element('span', { class: 'quiet' }, told))));
  }

  // The same question without what stands beside.
  alone(asked) {
    const question = new URLSearchParams(asked);
    question.set('second', 'nothing');
    return question;
  }

  tell(problems) {
    const { element } = coramp;
    document.getElementById('problems').replaceChildren(...problems.map((line) =>
      element('p', { role: 'alert', class: 'problem' }, line)));
    const save = document.getElementById('save');
    if (problems.length) save.removeAttribute('href');
    // What was computed before does not belong to what is set now, and goes out of sight.
    document.getElementById('results').hidden = problems.length > 0;
  }

  show(told) {
    this.tell(told.errors ?? []);
    if (told.errors) return;
    this.figures(told);
    const before = coramp.shown?.state() ?? null;
    coramp.shown = new coramp.Show(document.getElementById('show'), told.runs.map(coramp.runOf), before);
  }

  table({ title, columns, rows }) {
    const { element } = coramp;
    const head = columns.map((text) => element('th', { scope: 'col' }, text));
    const body = rows.map((row) => element('tr', {}, ...row.map((text) => element('td', {}, text))));
    return element('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': title },
      element('table', {}, element('caption', {}, title),
        element('thead', {}, element('tr', {}, ...head)), element('tbody', {}, ...body)));
  }

  figures({ world, answer, notes, moved, tables, folded, command }) {
    const { element } = coramp;
    document.getElementById('world').replaceChildren(...world.map(({ title, told }) =>
      element('li', {}, element('strong', {}, title), `: ${told}`)));
    const followed = moved.length
      ? [element('p', { class: 'quiet' }, `What was set moved ${moved.join(' and ')}.`)] : [];
    document.getElementById('answer').replaceChildren(
      element('p', { class: 'answer' }, answer),
      ...notes.map((line) => element('p', { class: 'note' }, line)), ...followed);
    document.getElementById('figures').replaceChildren(
      ...tables.map((found) => this.table(found)),
      ...folded.map((found) => element('details', {}, element('summary', {}, found.title), this.table(found))),
      element('p', { class: 'quiet' }, 'Saved as scenario, it runs by ', element('code', {}, command)));
  }
};

window.coramp = coramp;
coramp.studio = new coramp.Studio(document.getElementById('dials'));
