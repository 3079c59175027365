/* Entry points --------------------------------------------------------------------------------- */

int64_t system_size(void) { return sizeof(System); }
int64_t output_size(void) { return sizeof(Output); }

double polynomial_root(const double *c, int32_t n, double h) { return first_root(c, n, h); }
double polynomial_crossing(const double *c, int32_t n, double h, int32_t direction) {
  return first_crossing(c, n, h, direction);
}

Run *run_new(const System *s, Table *table) {
  Run *r = calloc(1, sizeof(Run));
  if (!r) return 0;
  r->s = s;
  r->table = table;
  r->n = s->n; r->m = s->m; r->c = s->c; r->width = s->m + s->c;
  r->order = s->order; r->stride = s->order + 1;
  r->kept_rows = s->lower_first[s->m];
  r->guards = 3 * s->m + 2 * s->c + s->rules.atoms + 2;
  r->arena = calloc(1, place_run(r, 0));
  if (!r->arena) { free(r); return 0; }
  place_run(r, r->arena);
  r->now.mode = r->e.l.mode = r->trial.l.mode = -1;
  return r;
}
void run_free(Run *r) { free(r->arena); free(r); }

/* Times at which the run is read: no approximation of the motion may span one of them. */
void run_read_at(Run *r, const double *times, int64_t count) { r->read_at = times; r->read_count = count; }

static void set_parameters(Run *r, const double *p) {
  const System *s = r->s;
  memcpy(r->p, p, sizeof(double) * s->parameters);
  series_prepare(&s->series, r->stride, r->p, r->series);
  values_prepare(&s->point, r->p, r->point);
  values_prepare(&s->surfaces, r->p, r->heights);
  values_prepare(&s->maps, r->p, r->maps);
  values_prepare(&s->restitution, r->p, r->restitution);
  values_prepare(&s->columns, r->p, r->columns);
  values_prepare(&s->atoms, r->p, r->atom_work);
  values_prepare(&s->choices, r->p, r->choice_work);
}

/* A run that has not begun. */
static void clear(Run *r, const Options *o, double t) {
  const System *s = r->s;
  r->o = *o;
  r->size = o->atol / o->rtol;
  memset(r->unknowns, 0, sizeof(double) * r->width);
  memset(r->drop, 0, sizeof(int32_t) * r->guards);
  r->instant.running = 0;
  r->instant.tied = -1;
  memset(r->instant.passing, 0, s->rules.atoms);
  memset(r->kinds, 0, sizeof r->kinds);
  r->step_count = r->event_count = r->segment_steps = r->history = r->hits = r->kept = 0;
  r->itinerary = r->active_count = r->several_count = 0;
  r->length = r->shortened = 0;
  r->t = r->begun = t;
  r->t_low = 0;
  r->since = 0;
  for (int i = 0; i < r->m; i++) { r->speed[i] = INFINITY; r->has_roots |= s->power[i] > 0; }
  r->limit = r->at_t = NAN;
  for (int i = 0; i < r->n; i++) r->at_x[i] = NAN;
  r->status = RUNNING;
  r->met = (Met){0};
  r->repelling = 0;
  r->reason = NO_REASON;
  r->where = 0;
  r->facts = 0;
  r->dependent = r->turned_mode = -1;
  r->segment_mode = r->due_impact = r->length_mode = -1;
}

void run_begin(Run *r, const Options *o, const Output *out, const double *x, const double *p,
               const int8_t *start_mode, double t, const double *motion) {
  clear(r, o, t);
  r->out = *out;
  memcpy(r->x, x, sizeof(double) * r->n);
  set_parameters(r, p);
  if (finite_all(r->x, r->n)) { begin(r, start_mode, motion); return; }
  memset(r->letter, 1, r->width);
  lay_out(r, r->letter, &r->now);
  r->mode = r->now.mode;
  finish(r, NOT_FINITE, SURFACE, 0);
}

/* Go on until the run ends, its arrays have no room for another step (FULL), or ``budget`` steps are
 * done (RUNNING). */
static int go_on(Run *r, int64_t *budget) {
  while (r->status == RUNNING) {
    if (r->o.dense && (r->out.steps + 2 > r->out.step_room || r->out.points + 4 > r->out.point_room
                       || r->out.events + 4 > r->out.event_room))
      return FULL;
    if (--*budget < 0) return RUNNING;
    step(r);
  }
  return r->status;
}

int run_continue(Run *r, int64_t budget) { return go_on(r, &budget); }

void run_read(const Run *r, double *numbers, int64_t *counts, int32_t *active, int32_t *several,
              double *rates) {
  numbers[0] = r->t;
  numbers[1] = r->limit;
  numbers[2] = r->at_t;
  int64_t head[] = {r->status, r->reason, r->where, r->mode, final_itinerary(r), r->step_count, r->event_count,
                    r->out.steps, r->out.points, r->out.events, r->active_count, r->several_count, r->facts};
  memcpy(counts, head, sizeof head);
  memcpy(active, r->active, sizeof(int32_t) * r->active_count);
  memcpy(several, r->several, sizeof(int32_t) * r->several_count);
  memcpy(rates, r->rates_of_several, sizeof(double) * r->several_count * r->n);
}

/* What a restart needs, besides the state. */
void run_motion(const Run *r, double *to) { if (r->s->rules.width) write_motion(r, to); }

/* Go on with larger arrays of the same content. */
void run_resume(Run *r, const Output *out) { r->out = *out; }

static void sample_into(Run *r, const Batch *b, int64_t i) {
  r->room = b->room;
  r->times = b->times ? b->times + i * b->times_stride : 0;
  run_read_at(r, r->times, r->times ? b->room : 0);
  r->sample_t = b->sample_t + i * b->room;
  r->sample_x = b->sample_x + i * b->room * r->s->dimension;
}

static void keep(Run *r, const Batch *b, int64_t i) {
  int nd = r->s->dimension;
  while (r->times && r->kept < r->room && r->times[r->kept] <= r->t && finite_all(r->x, nd))
    sample(r, r->times[r->kept], r->x);
  memcpy(b->x + i * nd, r->x, nd * sizeof(double));
  b->t[i] = r->t;
  b->status[i] = (int8_t)r->status;
  b->itinerary[i] = final_itinerary(r);
  int32_t *kinds = b->kinds + i * b->kinds_width, last = (int32_t)b->kinds_width - 1;
  for (int j = 0; j < last; j++) kinds[j] = (int32_t)r->kinds[j];
  kinds[last] = (int32_t)r->kinds[END] + (r->status != STOPPED);
  if (b->at_x) { memcpy(b->at_x + i * nd, r->at_x, nd * sizeof(double)); b->at_t[i] = r->at_t; }
  b->totals[0] += r->step_count;
  b->totals[1] += r->event_count;
}

/* Run a batch, ``budget`` steps of it at most; whether something is left for another call. ``next`` is zero
 * before the first, twice the number of runs done after it, and one more within a run. */
int run_many(Run *r, int64_t *next, const Batch *b, const Options *o, const int8_t *start_mode, int64_t budget) {
  static const Output none;
  for (; *next / 2 < b->count; *next += 1) {
    int64_t k = *next / 2, i = b->which ? b->which[k] : k;
    if (*next % 2 == 0) {
      sample_into(r, b, i);
      run_begin(r, o, &none, b->x0 + i * r->n, b->p + i * b->p_stride, start_mode, b->t0, 0);
    }
    *next |= 1;
    if (go_on(r, &budget) == RUNNING) return 1;
    keep(r, b, i);
  }
  return 0;
}
