/* Values at many states: nonsmooth/plot/web/engine.js ---------------------------------------------------- */

/* Values at ``count`` states with given multipliers: rates of the n states; of surfaces and gaps the rows that vanish in
 * sliding, then their functions; functions of stops and resets: n + 2 width + atoms numbers each. */
void run_sample(Run *r, const double *p, const double *x, int64_t count, const double *held, double *out) {
  int n = r->n, w = r->width, atoms = r->s->rules.atoms;
  r->begun = (Pair){0, 0};
  set_parameters(r, p);
  memcpy(r->held, held, sizeof(double) * w);
  for (; count > 0; count--, x += n, out += n + 2 * w + atoms) {
    set_inputs(r, x, r->held, r->none);
    first_values(r, 0);
    for (int i = 0; i < n + w; i++) out[i] = row_of(r, i)[0];
    memcpy(out + n + w, surface_values(r, x), sizeof(double) * w);
    for (int i = 0; i < atoms; i++) out[n + 2 * w + i] = row_of(r, n + 3 * w + i)[0];
  }
  memset(r->held, 0, sizeof(double) * w);
}
