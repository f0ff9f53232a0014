import { mount } from 'svelte';
import App from './App.svelte';
import './app.css';

const target = document.getElementById('app');
if (target === null) throw new Error('the page has no #app');
// In a task of its own: together with reading the program it would be a long one.
setTimeout(() => mount(App, { target }));
