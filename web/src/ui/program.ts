import { mount } from 'svelte';
import { continueHeadStart } from '../head_start';
import App from './App.svelte';
import './app.css';

continueHeadStart();

function begin(): void {
  const target = document.getElementById('app');
  if (target === null) throw new Error('the page has no #app');
  mount(App, { target });
}

// What begins early may be here before the page has been read to its end.
if (document.readyState === 'loading') document.addEventListener('DOMContentLoaded', begin, { once: true });
// In a task of its own: together with reading the program it would be a long one.
else setTimeout(begin);
