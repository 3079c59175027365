/* Values at many states: nonsmooth/plot/web/engine.js ---------------------------------------------------- */

/* Of ``count`` states with given multipliers: rates of the n states, then of surfaces and gaps what their laws set to
 * zero where they slide, then their functions: n + 2 width numbers each. */
void run_sample(Run *r, const double *p, const double *x, int64_t count, const double *held, double *out) {
  int n = r->n, w = r->width;
  r->begun = (Pair){0, 0};
  set_parameters(r, p);
  memcpy(r->held, held, sizeof(double) * w);
  for (; count > 0; count--, x += n, out += n + 2 * w) {
    set_inputs(r, x, r->held, r->none);
    first_values(r, 0);
    for (int i = 0; i < n + w; i++) out[i] = row_of(r, i)[0];
    memcpy(out + n + w, surface_values(r, x), sizeof(double) * w);
  }
  memset(r->held, 0, sizeof(double) * w);
}
