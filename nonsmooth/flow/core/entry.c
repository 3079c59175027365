/* Memory ------------------------------------------------------------------------------------------- */

#define PLACED(type, name, count) to->name = place(base, &used, sizeof(type), (size_t)(count));

static size_t place_layout(Layout *to, char *base, size_t used, int width, int guards) {
  LAYOUT_ARRAYS(PLACED)
  return used;
}

static size_t place_expansion(Expansion *to, char *base, size_t used, const Run *r) {
  size_t n = r->n, width = r->width, rows = r->guards, stride = r->stride, sets = r->s->sets ? r->m : 0;
  size_t of_sets = sets ? width : 0;
  used = place_layout(&to->l, base, used, r->width, r->guards);
  EXPANSION_ARRAYS(PLACED)
  return used;
}

static size_t place_decision(Run *r, char *base, size_t used) {
  size_t w = r->width, orders = (ORDERS + 1) * w;
  Decision none = {0}, *to = r->decision = place(base, &used, sizeof(Decision), 1);
  if (!base) { to = &none; r->decision = 0; }
  DECISION_ARRAYS(PLACED)
  for (int i = 0; i < SEVERAL; i++) {
    Motion *own = to->motion + i;
    own->state = LETTERS(w); own->order = LETTERS(w); own->before = LETTERS(w);
    own->nu = DOUBLES(w); own->series = DOUBLES(COMPARED * (size_t)r->n);
  }
  return used;
}

static size_t place_run(Run *to, char *base) {
  const System *s = to->s;
  size_t n = to->n, m = to->m, w = to->width, c = to->c, all = to->kept_rows, rows = to->guards, stride = to->stride;
  size_t used = 0, jumping = 0, q = s->combined, tried = m < MOST_ENUMERATED ? m : MOST_ENUMERATED, sums = tried * (tried - (tried > 0)) / 2;
  size_t most = larger(larger(s->point.size, s->columns.size), larger(s->surfaces.size, s->atoms.size));
  size_t atoms = s->rules.atoms, triggers = s->rules.triggers, clocks = s->rules.clocks;
  Run *r = to;
  for (size_t i = 0; i < m; i++) jumping += s->element[i].law == COMPLEMENTARITY_LAW;
  used = place_layout(&to->now, base, used, to->width, to->guards);
  used = place_expansion(&to->e, base, used, to);
  used = place_expansion(&to->trial, base, used, to);
  for (int i = 0; i < 2; i++) { Continuation *to = i ? &r->found : &r->chosen; CONTINUATION_ARRAYS(PLACED) }
  used = place_decision(to, base, used);
  { Instant *to = &r->instant; INSTANT_ARRAYS(PLACED) }
  { Equations *to = &r->equations; EQUATION_ARRAYS(PLACED) }
  RUN_ARRAYS(PLACED)
  return used;
}

/* Entry points --------------------------------------------------------------------------------- */

double polynomial_root(const double *c, int32_t n, double h) { return first_root(c, n, h); }
double polynomial_crossing(const double *c, int32_t n, double h, int32_t direction) {
  return first_crossing(c, n, h, direction);
}

/* Certificate of -dw/dnu of surfaces, of n rows. */
int32_t law_certificate(const double *m, int32_t n) {
  double *work = malloc(sizeof(double) * (4 * (size_t)n * n + 4 * n) + sizeof(int32_t) * n);
  int32_t found = work ? certificate(m, n, 0, work, (int32_t *)(work + 4 * (int64_t)n * n + 4 * n)) : NOTHING;
  free(work);
  return found;
}

/* Find the unique multipliers in [-1, 1] of surfaces with the rates a - m nu; whether they were found. */
int32_t law_solution(const double *a, const double *m, int32_t n, double *nu) {
  size_t square = (size_t)n * n, doubles = 60 * square + 100 * (size_t)n;
  double *work = calloc(doubles, sizeof(double));
  int32_t *pivot = calloc(8 * (size_t)n + 8, sizeof(int32_t)), found = 0;
  int8_t *letter = calloc(3 * (size_t)n, 1); /* states, contacts, positions */
  if (work && pivot && letter) {
    Block b = {.size = n, .tie = VANISHES, .a = work, .b = work + n, .floor = work + 2 * n, .share = work + 3 * n,
               .matrix = work + 3 * n + square, .state = letter, .is_contact = letter + n};
    memcpy(b.a, a, sizeof(double) * n);
    memcpy(b.matrix, m, sizeof(double) * square);
    for (int i = 0; i < n; i++) b.b[i] = 1;
    found = solve_block_of_many(&b, UNIQUE, letter + 2 * n, nu, work + 3 * n + 2 * square, pivot);
  }
  free(work); free(pivot); free(letter);
  return found;
}

/* As go_round: of four quadrants rates (4, 2) and slopes (4, 2, 2). */
int32_t law_round(double *rates, double *slopes, double *ratio, double *bend) {
  return go_round((double (*)[2])rates, (double (*)[4])slopes, ratio, bend);
}

Run *run_new(const System *s, Table *table) {
  Run *r = calloc(1, sizeof(Run));
  if (!r) return 0;
  r->s = s;
  r->table = table;
  r->n = s->n; r->m = s->m; r->c = s->c; r->width = s->m + s->c;
  r->order = s->order; r->stride = s->order + 1;
  r->kept_rows = s->kept_rows;
  r->guards = 3 * s->m + 2 * s->c + s->rules.atoms + 2;
  r->arena = calloc(1, place_run(r, 0));
  if (!r->arena) { free(r); return 0; }
  place_run(r, r->arena);
  r->now.mode = r->e.l.mode = r->trial.l.mode = -1;
  return r;
}
void run_free(Run *r) { end_implicit(r); free(r->arena); free(r); }

/* Sample times: no approximation of the motion spans one of them. */
void run_read_at(Run *r, const double *times, int64_t count) { r->read_at = times; r->read_count = count; }

/* Initial letters of elements with hysteresis, or none. */
void run_remember(Run *r, const int8_t *letter) { r->remembered = letter; }

/* Evaluate the parts of all programs that depend on parameters only. */
static void prepare(Run *r) {
  const System *s = r->s;
  const Values *program[] = {&s->point, &s->surfaces, &s->maps, &s->restitution, &s->columns, &s->atoms, &s->choices};
  double *work[] = {r->point, r->heights, r->maps, r->restitution, r->columns, r->atom_work, r->choice_work};
  series_prepare(&s->series, r->p, r->series);
  pairs_begin(s->series.size, r->stride, r->begun, r->series);
  for (int k = 0; k < 7; k++) {
    values_prepare(program[k], r->p, work[k]);
    pairs_begin(program[k]->size, 1, r->begun, work[k]);
  }
  prepare_implicit(r);
}

static void set_parameters(Run *r, const double *p) {
  memcpy(r->p, p, sizeof(double) * r->s->parameters);
  for (int i = 0; i < r->m; i++) r->cell[i] = -1;
  forget_rows(r);
  prepare(r);
}

/* A run that has not begun. */
static void clear(Run *r, const Options *o, Pair t) {
  const System *s = r->s;
  r->o = *o;
  r->size = o->atol / o->rtol;
  memset(r->unknowns, 0, sizeof(double) * r->width);
  memset(r->drop, 0, sizeof(int32_t) * r->guards);
  r->instant.running = 0;
  r->instant.tied = -1;
  memset(r->instant.passing, 0, s->rules.atoms);
  memset(r->instant.unfired, 0, s->rules.triggers);
  memset(&r->since, 0, offsetof(Run, past) - offsetof(Run, since));
  end_implicit(r);
  r->hold = INFINITY;
  r->begun = t;
  r->t = t.high;
  r->t_low = t.low;
  for (int i = 0; i < r->m; i++) { r->speed[i] = INFINITY; r->has_roots |= element(r, i)->power > 0; }
  r->limit = r->at_t = NAN;
  for (int i = 0; i < r->n; i++) r->at_x[i] = NAN;
  r->status = RUNNING;
  r->reason = NO_REASON;
  r->dependent = r->turned_mode = -1;
  r->segment_mode = r->due_impact = r->length_mode = -1;
}

void run_begin(Run *r, const Options *o, const Output *out, const double *x, const double *p,
               const int8_t *start_mode, double t, const double *motion) {
  clear(r, o, (Pair){t, motion ? *motion : 0});
  r->out = *out;
  memcpy(r->x, x, sizeof(double) * r->n);
  set_time_state(r);
  set_parameters(r, p);
  if (finite_all(r->x, r->n)) { begin(r, start_mode, motion); return; }
  memset(r->letter, 1, r->width);
  enter_mode(r);
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
    if (r->wants_program) { r->wants_program = 0; return NEEDS_PROGRAM; }
  }
  return r->status;
}

int run_continue(Run *r, int64_t budget) { return go_on(r, &budget); }

/* The first stop or reset whose condition was true at the start and that has not fired; -1 if there is none. */
static int unfired_event(const Run *r) {
  for (int k = 0; k < r->s->rules.triggers; k++) if (r->instant.unfired[k]) return r->s->rules.trigger_event[k];
  return -1;
}

void run_read(const Run *r, double *numbers, int64_t *counts, int32_t *active, int32_t *several,
              double *rates) {
  numbers[0] = r->t;
  numbers[1] = r->limit;
  numbers[2] = r->at_t;
  numbers[3] = r->t_error;
  int64_t head[] = {r->status, r->reason, r->where, r->mode, final_itinerary(r), r->step_count, r->event_count,
                    r->out.steps, r->out.points, r->out.events, r->active_count, r->several_count, r->facts,
                    unfired_event(r), r->implicit_count};
  memcpy(counts, head, sizeof head);
  memcpy(active, r->active, sizeof(int32_t) * r->active_count);
  memcpy(several, r->several, sizeof(int32_t) * r->several_count);
  memcpy(rates, r->rates_of_several, sizeof(double) * r->several_count * r->n);
}

/* The data of a restart, besides the state. */
void run_motion(const Run *r, double *to) { write_motion(r, to); }

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

/* Single steps of runs of the lanes ------------------------------------------------------------------ */

/* Whether the state is on a set, or has been far from it for a step. */
static int is_apart(Run *r, int f) {
  int k = size_of(r, f);
  if (r->letter[f] == 0 || r->letter[f] > OFF) return r->letter[f] == 0;
  const double *h = surface_values(r, r->x), *scales_of = surface_scales(r, r->x);
  return length_of(h + f, k) > CLOSE * scale_of_set(r, f, scales_of);
}

/* Rows of the guards of events that are located: those of stops and resets, then surfaces, if they are the driver's, and gaps;
 * their number. */
static int located_rows(const Run *r, const Suspended *m, int32_t *row) {
  int count = 0;
  for (int a = 0; a < r->s->rules.atoms; a++) if (r->s->rules.way[a] != UNWATCHED) row[count++] = r->now.atoms + a;
  for (int k = 0; k < r->now.atoms; k++)
    if (r->now.kind[k] == IMPACT_GUARD || (m->driven && r->now.kind[k] == SURFACE_GUARD)) row[count++] = k;
  return count;
}

/* Zeros at which the guard of a row may begin in lanes. */
static int most_zeros(const Run *r, const Suspended *m, int row) {
  int kind = r->now.kind[row];
  if (is_atom(kind) && r->now.side[row] == UNWATCHED) return r->order + 1;
  if (kind == IMPACT_GUARD || is_atom(kind)) return m->motion != 0;
  return m->driven ? 1 : row || r->s->sets ? 0 : 2;
}

/* Whether lanes can continue: no event is due, no zeros coincide, and the known ones are those that lanes know. */
static int is_plain(Run *r, const Suspended *m) {
  if (r->instant.running || r->due_impact >= 0 || r->hold < INFINITY) return 0;
  for (int row = 0; row < r->now.rows; row++) if (r->drop[row] > most_zeros(r, m, row)) return 0;
  EACH_SET(r, f) if (!is_apart(r, f)) return 0;
  for (int a = 0; a < r->s->rules.atoms; a++) if (r->s->rules.way[a] != UNWATCHED && !r->instant.side[a]) return 0;
  for (int j = m->driven ? 0 : r->m; j < r->width; j++) if (r->letter[j] == 0) return 0;
  return !m->driven || r->now.atoms == r->width; /* each surface has its guard */
}

/* The data of a run between two steps, here and in lanes. */
#define GOES_ON(OF) \
  OF(t, t) OF(since, since) OF(shortened, shortened) OF(step_count, steps) OF(event_count, events) \
  OF(segment_steps, segment_steps) OF(itinerary, itinerary) OF(history, history) OF(hits, hits) OF(kept, kept)
#define TAKEN(here, there) r->here = m->there;
#define GIVEN(here, there) m->there = r->here;

/* Kinds of events that lanes count, or keep for the driver. */
static int kinds_of(const Suspended *m) { return m->motion ? KINDS : SIMPLE_KINDS - 1; }

/* The number of a mode's letters in the driver's table is that of lanes. */
static void take(Run *r, const Batch *b, const Options *o, int64_t i, const Suspended *m) {
  static const Output none;
  clear(r, o, (Pair){b->t0, 0});
  r->out = none;
  sample_into(r, b, i);
  if (b->p_stride || !r->prepared) {
    set_parameters(r, b->p + i * b->p_stride);
    find_idle(r);
  }
  r->prepared = 1;
  memset(r->letter, -1, r->width);
  memcpy(r->x, b->x0 + i * r->n, sizeof(double) * r->n);
  measure_time(r);
  memcpy(r->x, m->x, sizeof(double) * r->n);
  GOES_ON(TAKEN)
  set_time_state(r);
  memcpy(r->letter, m->letter, r->width);
  if (r->s->sets) memcpy(r->unknowns, m->unknowns, sizeof(double) * r->width);
  lay_out(r, r->letter, &r->now);
  improve(r, &r->now, r->x, r->unknowns, 2);
  r->mode = r->now.mode;
  r->shown = r->segment_mode = shown_number(r, r->letter);
  r->drop[0] = m->drop;
  if (m->motion) {
    read_motion(r, m->motion);
    r->jumped = m->jumped;
  } else {
    memset(r->instant.residual, 0, sizeof(double) * r->s->stops);
    memset(r->instant.pending, 0, r->s->rules.triggers);
  }
  int32_t row[r->now.rows + 1];
  for (int k = located_rows(r, m, row) - 1; k >= 0; k--) {
    int atom = row[k] - r->now.atoms, side = m->side[k];
    if (atom >= 0) r->instant.side[atom] = r->instant.view[atom] = (int8_t)sign_of(side);
    if (abs(side) > 1) r->drop[row[k]] = 1;
  }
  memcpy(r->kinds, m->kinds, sizeof(int64_t) * kinds_of(m));
  r->length = m->length;
  if (m->length > 0) r->length_mode = r->mode;
  for (int k = 0; k < HISTORY && k < m->history; k++) {
    int64_t pattern = m->past[k].pattern;
    int64_t kinds = (pattern - (int32_t)pattern) >> 32;
    Guard guard = {(int)(kinds & 255), (int)(int32_t)pattern, 0};
    r->past[k] = (Happened){m->past[k].interval, pattern, (int32_t)(kinds >> 8), guard};
  }
}

/* Whether the guard of a row begins at a zero that the motion leaves. */
static int leaves_zero(Run *r, int row) {
  int i = r->now.index[row];
  if (r->drop[row] || r->now.kind[row] != SURFACE_GUARD || degree_of(r, i) < 2) return r->drop[row];
  const double *h = surface_values(r, r->x), *scale = surface_scales(r, r->x);
  int rate = element(r, i)->lower;
  if (!(fabs(h[i]) <= ON_SURFACE * scale[i] && fabs(h[rate]) > ON_SURFACE * scale[rate])) return 0;
  return h[rate] * r->letter[i] > 0;
}

/* Return a run to the lanes, or store its end. */
static void give(Run *r, const Batch *b, int64_t i, Suspended *m) {
  int64_t first = m->history > r->history - HISTORY ? m->history : r->history - HISTORY;
  m->status = r->status;
  m->steps = r->step_count;
  if (r->status != RUNNING) { keep(r, b, i); return; }
  if (b->at_x && isfinite(r->at_t)) {
    b->at_t[i] = r->at_t;
    memcpy(b->at_x + i * r->s->dimension, r->at_x, sizeof(double) * r->s->dimension);
  }
  memcpy(m->x, r->x, sizeof(double) * r->n);
  if (r->s->timed) m->x[r->n - 1] = r->t;
  memcpy(m->letter, r->letter, r->width);
  m->drop = r->drop[0];
  int32_t row[r->now.rows + 1];
  for (int k = located_rows(r, m, row) - 1; k >= 0; k--) {
    int atom = row[k] - r->now.atoms, side = atom < 0 ? r->letter[r->now.index[row[k]]] : r->instant.side[atom];
    m->side[k] = (int8_t)(leaves_zero(r, row[k]) ? 2 * side : side);
  }
  if (m->motion) write_motion(r, m->motion);
  memcpy(m->kinds, r->kinds, sizeof(int64_t) * kinds_of(m));
  m->length = r->length_mode == r->mode ? r->length : 0;
  for (int64_t k = first; k < r->history; k++)
    m->past[k % HISTORY] = (Recent){r->past[k % HISTORY].interval, r->past[k % HISTORY].pattern};
  GOES_ON(GIVEN)
  m->seen = m->history;
}

static void go_on_until_plain(Run *r, const Batch *b, int64_t i, Suspended *m) {
  while (r->status == RUNNING && (r->t >= r->o.t_end || !is_plain(r, m))) step(r); /* lanes do not decide a mode at the end */
  give(r, b, i, m);
}

/* Begin a run whose start the lanes cannot decide. */
void core_begin(void *run, const Batch *b, const Options *o, int64_t i, Suspended *m) {
  static const Output none;
  Run *r = run;
  m->history = m->hits = m->kept = 0;
  if (m->motion) r->jumped = m->jumped;
  sample_into(r, b, i);
  run_begin(r, o, &none, b->x0 + i * r->n, b->p + i * b->p_stride, 0, b->t0, 0);
  go_on_until_plain(r, b, i, m);
}

/* Read the kept event, if it has occurred. */
static void read_kept(Run *r, const Batch *b, int64_t i) {
  if (!b->at_x) return;
  r->at_t = b->at_t[i];
  memcpy(r->at_x, b->at_x + i * r->s->dimension, sizeof(double) * r->s->dimension);
}

/* Make the event of a guard that lanes have integrated to its zero. */
static void make_event(Run *r, const Suspended *m) {
  int32_t row[r->now.rows + 1];
  located_rows(r, m, row);
  int at = row[m->arrived - 1], atom = at - r->now.atoms;
  r->falls = 0;
  memset(r->instant.passing, 0, r->s->rules.atoms);
  if (atom < 0) { serve_between(r, at); return; }
  if (clock_of(r, atom) < 0) expand(r, r->letter, r->x, r->unknowns, &r->e);
  r->instant.passing[atom] = 1;
  arrive(r, &r->e, 0, -1);
}

/* Make the step that the lanes cannot decide. */
void core_step(void *run, const Batch *b, const Options *o, int64_t i, Suspended *m) {
  Run *r = run;
  take(r, b, o, i, m);
  read_kept(r, b, i);
  if (m->since == 0 && m->history != m->seen) see_limit(r); /* the last event was a lane's */
  if (r->status == RUNNING && m->near) near_set(r, 0, m->near == 2);
  else if (r->status == RUNNING && m->arrived) make_event(r, m);
  else if (r->status == RUNNING) step(r);
  go_on_until_plain(r, b, i, m);
}

/* The tree of itineraries that lanes share with the driver; their modes get the first numbers: above, below, sliding;
 * off a set and on it. */
Tree *lanes_tree(Run *r) {
  const int8_t surface[] = {1, -1, 0}, set[] = {OFF, 0};
  for (int k = 0; k < (!r->m ? 1 : r->s->sets ? 2 : 3); k++) {
    memset(r->start, r->s->sets ? set[k] : surface[k], r->m);
    memset(r->start + r->m, 1, r->c);
    numbered(r, r->start, 0);
  }
  return &r->table->tree;
}

/* Runs that a GPU leaves to the driver --------------------------------------------------------------- */

static int32_t node_of(Tree *tree, int64_t code) {
  int32_t node = 0;
  for (int shift = 2 * MOST_MODES - 2; shift >= 0; shift -= 2)
    if (code >> shift & 3) node = tree_child(tree, node, (int)(code >> shift & 3) - 1);
  return node;
}

static int64_t code_of(const Tree *tree, int32_t node) {
  int64_t code = 0, count = 0;
  for (int32_t k = node; k > 0; k = tree->node[k].parent) count++;
  int64_t kept = count < MOST_MODES ? count : MOST_MODES;
  for (int32_t k = node; k > 0; k = tree->node[k].parent, count--)
    if (count <= kept) code |= (int64_t)(tree->node[k].mode + 1) << 2 * (kept - count);
    else code |= FROZEN;
  return code;
}

/* A run of a GPU as the driver continues it, in ``past``, ``letter`` and ``side``. */
static Suspended suspended_of(Run *r, Left *left, Recent *past, int8_t *letter, int8_t *side) {
  double *x = (double *)(left + 1);
  const int64_t *above = (const int64_t *)(x + r->n);
  *letter = (int8_t)left->letter;
  for (int j = 0; j < r->s->stops; j++) side[j] = above[j] ? 1 : -1;
  return (Suspended){
      .t = left->t, .since = left->since, .length = left->length, .steps = left->steps, .events = left->events,
      .segment_steps = left->steps - left->entered, .kinds = left->kinds, .x = x, .letter = letter, .side = side,
      .past = past, .drop = (int32_t)left->drop, .itinerary = node_of(&r->table->tree, left->code)};
}

/* Make the step that the GPU cannot decide: the record is that of its end, or the status that of the run's end. */
static void step_left(Run *r, const Batch *b, const Options *o, int64_t i, Left *left) {
  Recent past[HISTORY];
  int8_t letter, side[r->s->stops + 1];
  Suspended m = suspended_of(r, left, past, &letter, side);
  (left->begun ? core_step : core_begin)(r, b, o, i, &m);
  if (m.status != RUNNING) return;
  int64_t *above = (int64_t *)((double *)(left + 1) + r->n);
  for (int j = 0; j < r->s->stops; j++) above[j] = -(int64_t)(side[j] > 0);
  left->t = m.t;
  left->since = m.since;
  left->length = m.length;
  left->steps = m.steps;
  left->events = m.events;
  left->entered = m.steps - m.segment_steps;
  left->letter = letter;
  left->drop = m.drop;
  left->begun = 1;
  if (!(left->code & FROZEN)) left->code = code_of(&r->table->tree, m.itinerary);
  b->status[i] = FALL_BACK;
}

/* Run a batch for at most ``budget`` steps, from records of ``width`` words that a GPU left or from none; 0, or the reason
 * for another call. ``next`` is zero before the first call, then twice the number of runs done, plus one within a run. */
static int run_all(Run *r, int64_t *next, const Batch *b, const Options *o, const int8_t *start_mode, int64_t *records,
                   int64_t width, int64_t budget) {
  static const Output none;
  for (; *next / 2 < b->count; *next += 1) {
    int64_t i = *next / 2;
    Left *left = records ? (Left *)(records + i * width) : 0;
    if (*next % 2 == 0 && !records) sample_into(r, b, i);
    if (*next % 2 == 0 && left && left->begun) {
      Recent past[HISTORY];
      int8_t letter, side[r->s->stops + 1];
      Suspended m = suspended_of(r, left, past, &letter, side);
      take(r, b, o, i, &m);
      read_kept(r, b, i);
    } else if (*next % 2 == 0) run_begin(r, o, &none, b->x0 + i * r->n, b->p + i * b->p_stride, start_mode, b->t0, 0);
    *next |= 1;
    int status = go_on(r, &budget);
    if (status == RUNNING || status == NEEDS_PROGRAM) return status;
    keep(r, b, i);
  }
  return 0;
}

int run_many(Run *r, int64_t *next, const Batch *b, const Options *o, const int8_t *start_mode, int64_t budget) {
  return run_all(r, next, b, o, start_mode, 0, 0, budget);
}

/* Continue the runs that a GPU left: for one step, after which runs with the status FALL_BACK continue from their records,
 * or to their ends. */
int run_left(Run *r, int64_t *next, const Batch *b, const Options *o, int64_t *records, int64_t width, int to_end,
             int64_t budget) {
  if (to_end) return run_all(r, next, b, o, 0, records, width, budget);
  for (; *next / 2 < b->count; *next += 2) {
    if (--budget < 0) return RUNNING;
    step_left(r, b, o, *next / 2, (Left *)(records + *next / 2 * width));
  }
  return 0;
}
