/* Steps of runs that are lanes' between them ------------------------------------------------------- */

/* Whether lanes can go on from here: nothing is to be served, and only the first guard has known zeros. */
static int is_plain(const Run *r) {
  if (r->instant.running || r->due_impact >= 0) return 0;
  for (int row = 0; row < r->now.rows; row++) if (r->drop[row] > (row || !r->m ? 0 : 2)) return 0;
  for (int j = 0; j < r->s->stops; j++) if (!r->instant.side[j]) return 0;
  return 1;
}

/* The number of a mode's letters in the driver's table is that of lanes. */
static void take(Run *r, const Batch *b, const Options *o, int64_t i, const Suspended *m) {
  static const Output none;
  clear(r, o, b->t0);
  r->out = none;
  if (b->p_stride || !r->prepared) set_parameters(r, b->p + i * b->p_stride);
  r->prepared = 1;
  memcpy(r->x, m->x, sizeof(double) * r->n);
  memcpy(r->letter, m->letter, r->width);
  lay_out(r, r->letter, &r->now);
  improve(r, &r->now, r->x, r->unknowns, 2);
  r->mode = r->shown = r->segment_mode = r->now.mode;
  r->drop[0] = m->drop;
  memcpy(r->instant.side, m->side, r->s->stops);
  memcpy(r->instant.view, m->side, r->s->stops);
  memset(r->instant.residual, 0, sizeof(double) * r->s->stops);
  memset(r->instant.pending, 0, r->s->rules.triggers);
  memcpy(r->kinds, m->kinds, sizeof(int64_t) * (SIMPLE_KINDS - 1));
  r->t = m->t;
  r->since = m->since;
  r->length = m->length;
  r->shortened = m->shortened;
  if (m->length > 0) r->length_mode = r->mode;
  r->step_count = m->steps;
  r->event_count = m->events;
  r->segment_steps = m->segment_steps;
  r->itinerary = m->itinerary;
  r->history = m->history;
  for (int k = 0; k < HISTORY && k < m->history; k++) {
    int64_t pattern = m->past[k].pattern;
    Met met = {(int)(pattern >> 32 & 255), (int)(int32_t)pattern, 0};
    r->past[k] = (Happened){m->past[k].interval, pattern, (int32_t)(pattern >> 40), met};
  }
}

/* Give a run back, or store it where it ended. */
static void give(Run *r, const Batch *b, int64_t i, Suspended *m) {
  int64_t first = m->history > r->history - HISTORY ? m->history : r->history - HISTORY;
  m->status = r->status;
  if (r->status != RUNNING) { keep(r, b, i); return; }
  if (b->at_x && isfinite(r->at_t)) {
    b->at_t[i] = r->at_t;
    memcpy(b->at_x + i * r->s->dimension, r->at_x, sizeof(double) * r->s->dimension);
  }
  memcpy(m->x, r->x, sizeof(double) * r->n);
  memcpy(m->letter, r->letter, r->width);
  m->drop = r->drop[0];
  memcpy(m->side, r->instant.side, r->s->stops);
  memcpy(m->kinds, r->kinds, sizeof(int64_t) * (SIMPLE_KINDS - 1));
  m->t = r->t;
  m->since = r->since;
  m->length = r->length_mode == r->mode ? r->length : 0;
  m->shortened = r->shortened;
  m->steps = r->step_count;
  m->events = r->event_count;
  m->segment_steps = r->segment_steps;
  m->itinerary = r->itinerary;
  for (int64_t k = first; k < r->history; k++)
    m->past[k % HISTORY] = (Recent){r->past[k % HISTORY].interval, r->past[k % HISTORY].pattern};
  m->history = r->history;
}

static void go_on_until_plain(Run *r, const Batch *b, int64_t i, Suspended *m) {
  while (r->status == RUNNING && (r->t >= r->o.t_end || !is_plain(r))) step(r); /* lanes give the end no mode */
  give(r, b, i, m);
}

/* Begin a run whose start is not clear to lanes. */
void core_begin(void *run, const Batch *b, const Options *o, int64_t i, Suspended *m) {
  static const Output none;
  Run *r = run;
  m->history = 0;
  run_begin(r, o, &none, b->x0 + i * r->n, b->p + i * b->p_stride, 0, b->t0, 0);
  go_on_until_plain(r, b, i, m);
}

/* Make the step that is not clear to lanes. */
void core_step(void *run, const Batch *b, const Options *o, int64_t i, Suspended *m) {
  Run *r = run;
  take(r, b, o, i, m);
  if (b->at_x) {
    r->at_t = b->at_t[i];
    memcpy(r->at_x, b->at_x + i * r->s->dimension, sizeof(double) * r->s->dimension);
  }
  step(r);
  go_on_until_plain(r, b, i, m);
}

/* The tree of itineraries that lanes share with the driver; their modes get the first numbers: above, below, sliding;
 * off a set and on it. */
Tree *lanes_tree(Run *r) {
  const int8_t surface[] = {1, -1, 0}, set[] = {OFF, 0};
  for (int k = 0; k < (!r->width ? 1 : r->s->sets ? 2 : 3); k++) {
    memset(r->start, r->s->sets ? set[k] : surface[k], r->width);
    mode_number(r->table, r->start);
  }
  return &r->table->tree;
}
