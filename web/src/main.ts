import { beginHeadStart } from './head_start';

// A module of its own, so that it is small and there first.
beginHeadStart();
void import('./ui/program');
