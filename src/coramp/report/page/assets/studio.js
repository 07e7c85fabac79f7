// The studio: what is set goes into the address; the server computes it; the picture follows.
coramp.Studio = class {
  constructor(form) {
    this.form = form;
    this.controls = new Map();
    form.querySelectorAll('[data-number], [data-choice]').forEach((control) => {
      this.controls.set(control.dataset.number ?? control.dataset.choice, control);
    });
    this.first = this.values();
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
  }

  changed(control) {
    const name = control.dataset.slider ?? control.dataset.number;
    if (control.dataset.slider) this.controls.get(name).value = control.value;
    const slider = this.form.querySelector(`[data-slider="${name}"]`);
    if (control.dataset.number && slider) slider.value = control.value;
    this.strange = [];
    this.compute();
  }

  reset() {
    this.strange = [];
    this.set(this.first);
    this.compute();
  }

  // What differs from where it started, and so is in the address.
  asked() {
    const differing = Object.entries(this.values()).filter(([name, value]) => value !== this.first[name]);
    return new URLSearchParams([...Object.entries(Object.fromEntries([...differing, ...this.strange]))]);
  }

  compute() {
    this.wanted = `${this.asked()}`;
    history.replaceState(null, '', this.wanted ? `?${this.wanted}` : location.pathname);
    document.getElementById('save').href = `scenario.toml?${this.wanted}`;
    document.getElementById('link').href = location.href;
    if (!this.busy) coramp.ready = this.work();
  }

  // One question at a time; what was set meanwhile is asked next, what lies between is left out.
  async work() {
    this.busy = true;
    const status = document.getElementById('status');
    while (this.wanted !== null) {
      const asked = this.wanted;
      this.wanted = null;
      const first = coramp.shown === undefined && this.values().second !== 'nothing';
      const started = performance.now();
      const slow = setTimeout(() => { status.textContent = 'computing …'; }, 300);
      try {
        // The first picture does not wait for the drivers beside it.
        if (first) this.show(await this.told(this.alone(asked)));
        this.show(await this.told(asked));
        this.took_ms = performance.now() - started;
        status.textContent = `computed and drawn in ${this.took_ms.toFixed(0)} ms`;
      } catch (error) {
        const gone = error instanceof TypeError ? 'the studio does not answer; is it still running?' : error.message;
        this.tell([gone]);
        status.textContent = '';
      } finally {
        clearTimeout(slow);
      }
    }
    this.busy = false;
  }

  async told(asked) { return (await fetch(`runs?${asked}`)).json(); }

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
    if (told.errors) {
      document.getElementById('status').textContent = '';
      return;
    }
    this.figures(told);
    const before = coramp.shown?.state() ?? null;
    coramp.shown = new coramp.Show(document.getElementById('show'), told.runs.map(coramp.runOf), before);
  }

  figures({ answer, notes, moved, table, command }) {
    const { element } = coramp;
    const head = table.columns.map((text) => element('th', { scope: 'col' }, text));
    const rows = table.rows.map((row) => element('tr', {}, ...row.map((text) => element('td', {}, text))));
    const followed = moved.length
      ? [element('p', { class: 'quiet' }, `What was set moved ${moved.join(' and ')}.`)] : [];
    document.getElementById('answer').replaceChildren(
      element('p', { class: 'answer' }, answer),
      ...notes.map((line) => element('p', { class: 'note' }, line)), ...followed);
    document.getElementById('figures').replaceChildren(
      element('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': table.title },
        element('table', {}, element('caption', {}, table.title),
          element('thead', {}, element('tr', {}, ...head)), element('tbody', {}, ...rows))),
      element('p', { class: 'quiet' }, 'Saved as scenario, it runs by ', element('code', {}, command)));
  }
};

window.coramp = coramp;
coramp.studio = new coramp.Studio(document.getElementById('dials'));
