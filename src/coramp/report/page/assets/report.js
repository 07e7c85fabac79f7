// The report: runs are unpacked when they are first shown; the choice is kept in the address.
coramp.packed = new Map();

coramp.run = (key) => {
  if (!coramp.packed.has(key)) {
    coramp.packed.set(key, coramp.unpacked(document.getElementById(key)));
  }
  return coramp.packed.get(key);
};

coramp.showChosen = async () => {
  const box = document.getElementById('show');
  const chosen = [...document.querySelectorAll('[data-chooses]')];
  const flow = chosen.find((select) => select.dataset.chooses === 'flow');
  const cells = JSON.parse(document.getElementById('cells').textContent);
  const keys = chosen.filter((select) => select !== flow).map((select) => select.value);
  const wanted = chosen.length ? keys.filter((key) => key !== '') : Object.keys(cells[0].runs);
  const cell = flow ? cells[Number(flow.value)] : cells[0];
  try {
    const names = [...new Set(wanted)].map((key) => cell.runs[key]).filter(Boolean);
    coramp.shown = new coramp.Show(box, await Promise.all(names.map(coramp.run)));
  } catch (error) {
    coramp.problem(box, error);
  }
};

coramp.ready = coramp.showChosen();
document.querySelectorAll('[data-chooses]').forEach((select) => {
  select.addEventListener('change', () => { coramp.ready = coramp.showChosen(); });
});
window.coramp = coramp;
