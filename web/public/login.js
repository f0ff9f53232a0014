// A page of its own, so that somebody who is not let in loads nothing else.
const at = (id) => document.getElementById(id);
const [form, token, problem] = ['login', 'token', 'problem'].map(at);

async function ask(method, body) {
  const reply = await fetch('./api/v1/session', { method, body: body && JSON.stringify(body), cache: 'no-store' });
  return { status: reply.status, answer: await reply.json() };
}

const watches = (role) => role !== null && role !== 'ingest';

async function logIn(text) {
  problem.textContent = '';
  try {
    const { status, answer } = await ask('POST', { token: text.trim() });
    if (status === 409 || (status === 200 && watches(answer.role))) location.replace('./');
    else if (status === 200) problem.textContent = 'That token is for programs that send parts of the map; it shows no scene.';
    else if (status === 429) problem.textContent = 'Too many wrong ones came from here. Wait a few seconds and try again.';
    else problem.textContent = 'That is not known, or not any more. A code works once, for a quarter of an hour.';
  } catch {
    problem.textContent = 'The robot does not answer. Is the link there?';
  }
  token.focus();
  token.select();
}

form.addEventListener('submit', (event) => {
  event.preventDefault();
  void logIn(token.value);
});
at('show').addEventListener('change', ({ target }) => {
  token.type = target.checked ? 'text' : 'password';
});
at('out').addEventListener('click', async () => {
  await ask('DELETE');
  location.reload();
});

const code = decodeURIComponent(location.hash.slice(1));
if (code !== '') {
  // Not to stay in the history of the browser.
  history.replaceState(null, '', location.pathname);
  token.value = code;
  void logIn(code);
} else {
  const { answer } = await ask('GET').catch(() => ({ answer: { needs_token: true, role: null } }));
  if (!answer.needs_token) location.replace('./');
  if (watches(answer.role)) {
    form.hidden = true;
    at('known').hidden = false;
    at('role').textContent = answer.role;
    at('on').focus();
  }
}
