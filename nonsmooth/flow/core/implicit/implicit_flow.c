/* Stiff flows of known durations: implicit steps of legs (implicit_legs.c), of a run without elements whose atoms are the
 * monitored functions.
 */

/* A flow as such a leg; whether its steps are implicit. */
typedef struct {
  System s;
  Table *table;
  Run *r;
  Leg l;
  Slopes g;
  Variation v;
  void *memory;
  int is_used;
} ImplicitFlow;

static void end_flow(Flow *w) {
  ImplicitFlow *m = w->implicit;
  if (!m) return;
  if (m->r) run_free(m->r);
  table_free(m->table);
  free(m->memory);
  free(m);
  w->implicit = 0;
}

/* Allocate implicit steps; 0 where that fails. */
static int begin_flow(Flow *w) {
  const Field *f = w->field;
  ImplicitFlow *m = w->implicit = calloc(1, sizeof(ImplicitFlow) + sizeof(int32_t) * (f->watched + 1 + f->columns));
  if (!m) return 0;
  int32_t *zeros = (int32_t *)(m + 1), *direction = zeros + f->watched + 1;
  for (int k = 0; k < f->columns; k++) direction[k] = k < f->starts ? -1 : k - f->starts;
  m->s = (System){.n = f->n, .dimension = f->n - (f->group[f->n - 1] < 0), .parameters = f->columns - f->starts, .order = f->order,
                  .series = f->series, .free = f->series, .bent_guards = zeros, .affine = 1,
                  .rules = {.atoms = f->watched, .way = zeros}, .derivatives = f->derivatives, .implicit = &m->s.series};
  m->table = table_new(0);
  m->r = run_new(&m->s, m->table);
  m->memory = m->r ? calloc(1, place_variation(m->r, f->columns, &m->g, &m->v, 0)) : 0;
  if (!m->memory) { end_flow(w); return 0; }
  clear(m->r, &(Options){.rtol = w->tol / SAFETY, .atol = w->tol}, (Pair){0, 0});
  m->r->p = (double *)w->p;
  prepare(m->r);
  place_variation(m->r, f->columns, &m->g, &m->v, m->memory);
  begin_slopes(m->r, &m->g);
  m->l = (Leg){.columns = f->columns, .starts = f->starts, .hit = -1, .duration = w->whole, .tol = w->tol, .direction = direction};
  return 1;
}

/* Continue the leg from a state. */
static void enter_flow(const Flow *w, const double *z) {
  ImplicitFlow *m = w->implicit;
  memcpy(m->r->x, z, sizeof(double) * w->field->n);
  expand_first(m->r, m->r->x, m->r->unknowns, &m->r->e);
  m->l.left = w->left;
}

/* Make an implicit step, which writes the polynomials of the flow; its length, or 0. */
static double implicit_flow_step(Flow *w, const double *z) {
  ImplicitFlow *m = w->implicit;
  Run *r = m->r;
  enter_flow(w, z);
  double h = r->e.finite ? solve_step(r, &m->l, w->left) : 0;
  m->is_used = h > 0;
  if (!m->is_used || !w->field->watched) return h;
  write_step(r, &r->e, h);
  memcpy(w->states, r->e.states, sizeof(double) * r->n * r->stride);
  memcpy(w->watched, r->e.guards, sizeof(double) * w->field->watched * r->stride);
  return h;
}

/* The length of the next step, of the cheaper kind; zero or negative where there is none. */
static double next_step(Flow *w, const double *z, int64_t step) {
  const Field *f = w->field;
  ImplicitFlow *m = w->implicit;
  int is_whole = f->columns == 0 || (f->derivatives.count > 0 && f->starts == f->n);
  double h = m && m->is_used ? implicit_flow_step(w, z) : 0;
  if (h > 0) return h;
  h = expand_flow(w, z) ? flow_step(w) : 0;
  if (step % CHECK_AGAIN < CHECK_AGAIN - 1 || !(w->left > FAR_AWAY * h) || w->sign < 0 || !is_whole) return h;
  if (RADAU[1].s * f->n > MOST_STATES / 2 || !(m || begin_flow(w))) return h;
  m = w->implicit;
  enter_flow(w, z);
  if (!is_step_held(m->r, &m->l, h)) return h;
  double longer = implicit_flow_step(w, z);
  return longer > 0 ? longer : expand_flow(w, z) ? h : 0;
}

/* Move z by a step. */
static void make_step(Flow *w, double h, double *z) {
  ImplicitFlow *m = w->implicit;
  if (!m || !m->is_used) { advance_flow(w, h, z); return; }
  m->l.y = z + w->field->n;
  if (!move_implicit(m->r, &m->l, &m->g, h, 0)) z[0] = NAN;
  else memcpy(z, m->r->x, sizeof(double) * w->field->n);
  w->left = h == w->left ? 0 : w->left - h;
}

/* Integrate a flow to its end by the cheaper steps. */
static void run_whole_flow(Flow *w, double *z, int64_t most_steps) {
  for (int64_t step = 0; step < most_steps && w->left > 0; step++) {
    double h = next_step(w, z, step);
    if (!(h > 0)) break;
    make_step(w, h, z);
  }
  end_flow(w);
}
