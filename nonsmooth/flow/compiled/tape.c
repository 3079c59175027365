/* The reference driver in C for any number of surfaces and impacts; the system is data, not code.
 *
 * The functions have the names and the order of nonsmooth/flow/reference/{modes,stepper,switching,contacts,
 * driver}.py; read those first. What is rare and slow anyway (points where the jet is not finite, starts in
 * repelling sliding, stability that no simple test shows) is handed over to them.
 */
#define HISTORY 48
#define TRIED 256 /* modes that are tried one by one, where the rates do not decide */
#define FEW 3 /* surfaces of which all modes are tried where no matrix is known to have one solution */
#define SEVERAL 16 /* modes that can continue, for the message */
#define TINY 2.2250738585072014e-308

/* Entries of a sparse matrix in the order of a program's outputs. */
typedef struct { int32_t count, pad; const int32_t *row, *column; } Entries;

typedef struct {
  int32_t n, dimension, timed, m, c, parameters, stops, resets, order, slope_outputs;
  Series series;      /* field, layer, surfaces and gaps, factors, stops and resets, slope_outputs slopes */
  Values point;       /* layer, factors, entries of slope, gradients of layer, surfaces and gaps, stops */
  Values surfaces;    /* surfaces, gaps, rates of gaps; entries of their gradients */
  Values maps;        /* states after each reset */
  Values restitution; /* of each impact */
  Values columns;     /* entries of the field's derivatives by the unknowns */
  Entries slope, layer_gradient, height_gradient, stop_gradient, surface_gradient, column;
  const int32_t *stop_direction, *reset_direction, *continuous, *scaled, *carries, *component;
  const int32_t *slope_output, *slope_moves; /* (m + c, m + c): output of the series or -1; whether it moves */
  int32_t linear, pad;
} System;

/* The guards of a mode, and what slides in it. */
typedef struct {
  int8_t *letter; /* +1, -1, 0 for each surface; +1, 0 for open and closed contacts */
  int32_t rows, slides, mode, branches;
  int32_t *sliding, *kind, *index, *side;
} Layout;

typedef struct {
  Layout l;
  int finite;
  double *states, *guards, *series, *allowed, *of_guards, *scale, *steep, *inverse;
} Expansion;

/* A mode that can continue, and the zeros of its guards. */
typedef struct { int8_t *letter; int32_t strict, *drop; double *unknowns; } Continuation;

/* Modes met, by number: their letters. */
typedef struct { Tree tree; int32_t width, count, room; int8_t *letter; int32_t *bucket, buckets; } Table;

/* What a run writes, when dense: steps, points and events, emptied by the caller when full. */
typedef struct {
  int64_t steps, points, events, step_room, point_room, event_room;
  double *start, *coefficients, *point_t, *point_x, *event_t, *event_x, *event_after_x;
  int32_t *step_mode, *event_kind, *event_before, *event_after, *event_guard;
} Output;

/* The guard that is served. */
typedef struct { int kind, index, side; } Met;

typedef struct {
  Options o;
  const System *s;
  Table *table;
  double *p;
  int32_t n, m, c, width, order, stride, guards;
  double t, begun, last_event, limit, at_t, *x, *at_x, *unknowns;
  int8_t *letter, *start; /* present ones, and those that a choice is made from */
  Layout now; /* of the present mode */
  Met met;
  int32_t mode, status, reason, where, due, due_impact, *drop, *side, *fired;
  int64_t step_count, event_count, kinds[KINDS], segment_steps, history;
  int32_t itinerary, segment_mode;
  double interval[HISTORY];
  int64_t pattern[HISTORY];
  int32_t kind[HISTORY];
  double size, length, shortened;
  int32_t length_mode, active_count, several_count, several[SEVERAL], *active;
  Expansion e, trial;
  Continuation chosen, one, first, rest, found;
  Output out;
  int64_t hits, kept, room; /* of the section; samples kept, in row of the results */
  const double *times;
  double *sample_t, *sample_x;
  /* programs' values, inputs, yardsticks */
  double *series, *point, *heights, *maps, *restitution, *columns, *input, *held, *none, *slope, *vector, *sample;
  double *before, *at_work, *work, *gradient_row, *rates, *lam, *matrix, *small;
  int32_t *pending, *sparse, *involved;
  void *arena;
} Run;

static void finish(Run *r, int status, int reason, int where) {
  if (r->status == RUNNING) { r->status = status; r->reason = reason; r->where = where; }
}

/* Modes by number ------------------------------------------------------------------------------ */

static uint32_t hash_of(const int8_t *letter, int width) {
  uint32_t h = 2166136261u;
  for (int i = 0; i < width; i++) h = (h ^ (uint8_t)letter[i]) * 16777619u;
  return h;
}

static int32_t mode_number(Table *t, const int8_t *letter) {
  uint32_t at = hash_of(letter, t->width) % (uint32_t)t->buckets;
  for (; t->bucket[at] >= 0; at = (at + 1) % (uint32_t)t->buckets)
    if (!memcmp(t->letter + (int64_t)t->bucket[at] * t->width, letter, t->width)) return t->bucket[at];
  if (t->count == t->room) {
    int32_t room = 2 * t->room, buckets = 4 * room;
    int8_t *more = realloc(t->letter, (size_t)room * (t->width + 1));
    int32_t *bucket = malloc(sizeof(int32_t) * buckets);
    if (!more || !bucket) return 0;
    memset(bucket, -1, sizeof(int32_t) * buckets);
    for (int32_t k = 0; k < t->count; k++) {
      uint32_t place = hash_of(more + (int64_t)k * t->width, t->width) % (uint32_t)buckets;
      while (bucket[place] >= 0) place = (place + 1) % (uint32_t)buckets;
      bucket[place] = k;
    }
    free(t->bucket);
    t->letter = more; t->bucket = bucket; t->room = room; t->buckets = buckets;
    return mode_number(t, letter);
  }
  memcpy(t->letter + (int64_t)t->count * t->width, letter, t->width);
  t->bucket[at] = t->count;
  return t->count++;
}

Table *table_new(int32_t width) {
  Table *t = calloc(1, sizeof(Table));
  t->tree = (Tree){malloc(64 * sizeof(Node)), 1, 64};
  t->tree.node[0] = (Node){.parent = -1, .mode = -1};
  t->width = width; t->room = 64; t->buckets = 256;
  t->letter = malloc((size_t)t->room * (width + 1));
  t->bucket = malloc(sizeof(int32_t) * t->buckets);
  memset(t->bucket, -1, sizeof(int32_t) * t->buckets);
  return t;
}
int32_t table_modes(const Table *t) { return t->count; }
int32_t table_size(const Table *t) { return t->tree.size; }
void table_read(const Table *t, int32_t *parent, int32_t *mode, int8_t *letter) {
  tree_read(&t->tree, parent, mode);
  memcpy(letter, t->letter, (size_t)t->count * t->width);
}
void table_free(Table *t) { free(t->tree.node); free(t->letter); free(t->bucket); free(t); }

/* Modes: nonsmooth/model/coupled.py, nonsmooth/flow/reference/modes.py --------------------------------- */

/* Whether a multiplier makes no difference: on its surface, or at an open contact. */
static int is_idle(const Run *r, const int8_t *letter, int i) {
  const System *s = r->s;
  if (i >= s->m) return 0;
  if (s->continuous[i]) return 1;
  for (int j = 0; j < s->c; j++) if (s->carries[i * s->c + j] && letter[s->m + j]) return 1;
  return 0;
}

static int add_row(Layout *l, int kind, int index, int side) {
  int k = l->rows++;
  l->kind[k] = kind; l->index[k] = index; l->side[k] = side;
  return k;
}

static int is_pair(const Run *r, const Layout *l) { return l->slides == 2 && l->sliding[1] < r->m; }

static void lay_out(const Run *r, const int8_t *letter, Layout *l) {
  const System *s = r->s;
  memmove(l->letter, letter, r->width);
  l->rows = l->slides = l->branches = 0;
  l->mode = mode_number(r->table, letter);
  for (int i = 0; i < r->width; i++) {
    if (letter[i] == 0 && !is_idle(r, letter, i)) l->sliding[l->slides++] = i;
    if (i >= s->m) add_row(l, letter[i] ? IMPACT_GUARD : RELEASE_GUARD, i - s->m, letter[i]);
    else if (letter[i]) add_row(l, SURFACE_GUARD, i, letter[i]);
    else { add_row(l, EXIT_GUARD, i, 1); add_row(l, EXIT_GUARD, i, -1); }
  }
  for (int j = 0; j < s->stops; j++) add_row(l, STOP_GUARD, j, s->stop_direction[j]);
  for (int j = 0; j < s->resets; j++) add_row(l, RESET_GUARD, j, s->reset_direction[j]);
  int first = 0, w = r->width, moves = 0;
  for (int i = l->slides - 1; i >= 0; i--) if (l->sliding[i] < s->m) first = l->sliding[i];
  if (is_pair(r, l)) {
    int one = l->sliding[0], two = l->sliding[1];
    moves |= s->slope_moves[one * w + one] | s->slope_moves[one * w + two];
    moves |= s->slope_moves[two * w + one] | s->slope_moves[two * w + two];
    l->branches = moves ? 2 : 0;
  } else {
    for (int i = 0; i < l->slides; i++) l->branches += s->slope_moves[l->sliding[i] * (w + 1)];
  }
  for (int k = 0; k < l->branches; k++) add_row(l, BRANCH_GUARD, first, 0);
}

/* Letters as the multipliers that are known: +1 and -1, 0 for what slides, open and closed contacts. */
static const double *held_of(Run *r, const int8_t *letter) {
  for (int i = 0; i < r->width; i++) r->held[i] = i < r->m ? letter[i] : 0;
  return r->held;
}

/* The moving inputs: states, lambda and reactions, then nu. */
static void set_inputs(Run *r, const double *x, const double *held, const double *unknowns) {
  double *in = r->input;
  memcpy(in, x, sizeof(double) * r->n);
  in += r->n;
  for (int i = 0; i < r->width; i++)
    in[i] = held[i] + (i < r->m && r->s->scaled[i] ? 0 : unknowns[i]);
  in += r->width;
  for (int i = 0; i < r->m; i++) if (r->s->scaled[i]) *in++ = unknowns[i];
}

static double out_of(const Values *t, const double *w, int k) { return w[t->output[k]]; }

/* Layer, factors, slope and gradients at a point; r->slope is dense. */
static void yardsticks(Run *r, const double *x, const double *held, const double *unknowns) {
  const Entries *slope = &r->s->slope;
  set_inputs(r, x, held, unknowns);
  values_run(&r->s->point, r->input, r->p, r->point);
  for (int k = 0; k < slope->count; k++)
    r->slope[slope->row[k] * r->width + slope->column[k]] = out_of(&r->s->point, r->point, 2 * r->width + k);
}
static double layer_of(const Run *r, int i) { return out_of(&r->s->point, r->point, i); }
static double factor_of(const Run *r, int i) { return out_of(&r->s->point, r->point, r->width + i); }

/* Sums over the states of |gradient| times a vector, for each row; infinite slopes, those of a square root
 * at zero, say nothing about rounding and are left out where asked for. */
static void gradient_sums(const Run *r, const Values *t, const double *w, int first, const Entries *g, int rows,
                          const double *vector, int finite_only, double *sum) {
  for (int i = 0; i < rows; i++) sum[i] = 0;
  for (int k = 0; k < g->count; k++) {
    double slope = fabs(out_of(t, w, first + k));
    if (!finite_only || slope < INFINITY) sum[g->row[k]] += slope * vector[g->column[k]];
  }
}

/* Yardsticks of the guards from those of surfaces, of sliding multipliers and of stops. */
static void guard_sums(Run *r, const Expansion *e, const double *vector, int finite_only, double *result) {
  const System *s = r->s;
  const Layout *l = &e->l;
  int w = r->width, first = 2 * w + s->slope.count, row = 0, slides = l->slides;
  double *layer = r->small, *height = layer + w, *stop = height + w, *through = stop + s->stops + s->resets;
  gradient_sums(r, &s->point, r->point, first, &s->layer_gradient, w, vector, finite_only, layer);
  first += s->layer_gradient.count;
  gradient_sums(r, &s->point, r->point, first, &s->height_gradient, w, vector, finite_only, height);
  first += s->height_gradient.count;
  gradient_sums(r, &s->point, r->point, first, &s->stop_gradient, s->stops + s->resets, vector, finite_only, stop);
  for (int i = 0; i < slides; i++) {
    through[i] = 0;
    for (int j = 0; j < slides; j++) {
      double a = fabs(e->inverse[i * slides + j]);
      if (a != 0) through[i] += a * layer[l->sliding[j]];
    }
  }
  for (int i = 0; i < slides; i++) layer[l->sliding[i]] = through[i];
  double worst = 0;
  for (int i = 0; i < w; i++) worst = larger(layer[i], worst);
  for (; row < l->rows; row++) {
    int kind = l->kind[row], index = l->index[row];
    if (kind == SURFACE_GUARD) result[row] = height[index];
    else if (kind == IMPACT_GUARD) result[row] = height[s->m + index];
    else if (kind == EXIT_GUARD) result[row] = layer[index];
    else if (kind == RELEASE_GUARD) result[row] = layer[s->m + index];
    else if (kind == STOP_GUARD) result[row] = stop[index];
    else if (kind == RESET_GUARD) result[row] = stop[s->stops + index];
    else result[row] = worst;
  }
}

static const double *row_of(const Run *r, int output) {
  return r->series + (int64_t)r->s->series.output[output] * r->stride;
}

static const double *slope_row(const Run *r, int i, int j) {
  static const double zero[P + 1];
  int output = r->s->slope_output[i * r->width + j];
  return output < 0 ? zero : row_of(r, r->n + 3 * r->width + r->s->stops + r->s->resets + output);
}

/* The slope of one multiplier, determinant and trace of that of two, or its diagonal, turned to begin
 * positive. */
static void branch_rows(const Run *r, const Layout *l, int count, double *g) {
  int stride = r->stride, row = 0;
  if (is_pair(r, l)) {
    int i = l->sliding[0], j = l->sliding[1];
    const double *a = slope_row(r, i, i), *b = slope_row(r, i, j), *c = slope_row(r, j, i), *d = slope_row(r, j, j);
    for (int k = 0; k < count; k++) {
      g[k] = convolve(a, d, k, 0, k) - convolve(b, c, k, 0, k);
      g[stride + k] = a[k] + d[k];
    }
    row = 2;
  } else {
    for (int i = 0; i < l->slides; i++)
      if (r->s->slope_moves[l->sliding[i] * (r->width + 1)])
        memcpy(g + (int64_t)row++ * stride, slope_row(r, l->sliding[i], l->sliding[i]), sizeof(double) * count);
  }
  for (int j = 0; j < row; j++) {
    double *own = g + (int64_t)j * stride, turn = 1;
    for (int k = 0; k < count; k++) if (own[k] != 0) { turn = ns_sign(own[k]); break; }
    for (int k = 0; k < count; k++) own[k] *= turn;
  }
}

/* Guards from the series (or, with count 1, values) of what they are made of. */
static void guard_rows(Run *r, const Layout *l, const double *series, int count, double *guards) {
  const System *s = r->s;
  int w = r->width, n = r->n, stride = r->stride;
  for (int row = 0; row < l->rows; row++) {
    int kind = l->kind[row], i = l->index[row], side = l->side[row];
    double *g = guards + (int64_t)row * stride;
    if (kind == SURFACE_GUARD || kind == IMPACT_GUARD) {
      const double *h = row_of(r, n + w + i + (kind == IMPACT_GUARD ? s->m : 0));
      for (int k = 0; k < count; k++) g[k] = side * h[k];
    } else if (kind == RELEASE_GUARD) {
      memcpy(g, series + (int64_t)(s->m + i) * stride, sizeof(double) * count);
    } else if (kind == EXIT_GUARD && is_idle(r, l->letter, i)) {
      const double *layer = row_of(r, n + i);
      for (int k = 0; k < count; k++) g[k] = -side * layer[k];
    } else if (kind == EXIT_GUARD) {
      const double *factor = row_of(r, n + 2 * w + i), *lam = series + (int64_t)i * stride;
      double turn = 1;
      for (int k = 0; k < count; k++) if (factor[k] != 0) { turn = ns_sign(factor[k]); break; }
      for (int k = 0; k < count; k++) g[k] = turn * (factor[k] - side * lam[k]);
    } else if (kind == BRANCH_GUARD) {
      branch_rows(r, l, count, g);
      break;
    } else {
      const double *stop = row_of(r, n + 3 * w + i + (kind == RESET_GUARD ? s->stops : 0));
      memcpy(g, stop, sizeof(double) * count);
    }
  }
}

/* Coefficients k of the multipliers that slide keep those of the layer's rates at zero. */
static void follow_layer(Run *r, Expansion *e, int k, const int32_t *start) {
  int slides = e->l.slides;
  for (int i = 0; i < slides; i++) {
    double sum = 0;
    for (int q = start[i]; q < start[i + 1]; q++) {
      int j = start[slides + 1 + q];
      sum += e->inverse[i * slides + j] * row_of(r, r->n + e->l.sliding[j])[k];
    }
    e->series[(int64_t)e->l.sliding[i] * r->stride + k] = -sum;
  }
}

/* Coefficient k of states and multipliers as the inputs of the series. */
static void inputs_of(Run *r, const Expansion *e, int k) {
  double *x = r->vector, *lam = x + r->n;
  for (int i = 0; i < r->n; i++) x[i] = e->states[(int64_t)i * r->stride + k];
  for (int i = 0; i < r->width; i++) lam[i] = e->series[(int64_t)i * r->stride + k];
  set_inputs(r, x, k ? r->none : r->held, lam);
}

/* Coefficients k of all that a mode needs. */
static void advance_series(Run *r, const Layout *l, int k) {
  const Series *t = &r->s->series;
  int slides = 0;
  for (int i = 0; i < r->width; i++) slides |= l->letter[i] == 0;
  if (slides) series_rules(t, t->moving, t->moving_count, k, r->stride, r->input, r->series);
  else series_rules(t, t->free, t->free_count, k, r->stride, r->input, r->series);
}

static void jets(Run *r, Expansion *e) {
  const Series *t = &r->s->series;
  int slides = e->l.slides, order = r->order, stride = r->stride;
  int32_t *start = r->sparse, *column = start + slides + 1, count = 0;
  for (int i = 0; i < slides; i++) {
    start[i] = count;
    for (int j = 0; j < slides; j++) if (e->inverse[i * slides + j] != 0) column[count++] = j;
  }
  start[slides] = count;
  for (int k = 0; k <= order; k++) {
    inputs_of(r, e, k);
    advance_series(r, &e->l, k);
    if (k && slides) {
      follow_layer(r, e, k, start);
      inputs_of(r, e, k);
      series_rules(t, t->late, t->late_count, k, stride, r->input, r->series);
    }
    if (k < order)
      for (int i = 0; i < r->n; i++) e->states[(int64_t)i * stride + k + 1] = row_of(r, i)[k] / (k + 1);
  }
  guard_rows(r, &e->l, e->series, order + 1, e->guards);
}

/* Jets of a mode at x, with the multipliers of what slides; inverses of the layer's slope. */
static void expand(Run *r, const int8_t *letter, const double *x, const double *unknowns, Expansion *e) {
  int w = r->width, order = r->order, stride = r->stride;
  lay_out(r, letter, &e->l);
  yardsticks(r, x, held_of(r, letter), unknowns);
  int slides = e->l.slides;
  for (int i = 0; i < slides; i++)
    for (int j = 0; j < slides; j++)
      r->work[i * slides + j] = r->slope[e->l.sliding[i] * w + e->l.sliding[j]];
  invert(r->work, slides, e->inverse);
  double zero = 0;
  memset(e->series, 0, sizeof(double) * w * stride);
  for (int i = 0; i < r->n; i++) e->states[(int64_t)i * stride] = x[i];
  for (int i = 0; i < slides; i++) e->series[(int64_t)e->l.sliding[i] * stride] = unknowns[e->l.sliding[i]];
  double *one = r->vector, *near = one + r->n;
  for (int i = 0; i < r->n; i++) {
    int moves = i < r->s->dimension;
    e->allowed[i] = moves ? SAFETY * (r->o.atol + r->o.rtol * fabs(x[i])) : 0;
    one[i] = 1;
    near[i] = r->size + fabs(x[i]);
  }
  guard_sums(r, e, e->allowed, 0, e->of_guards);
  guard_sums(r, e, one, 0, e->steep);
  guard_sums(r, e, near, 1, e->scale);
  jets(r, e);
  for (int i = 0; i < r->n; i++) for (int k = 0; k <= order; k++) zero += 0 * e->states[(int64_t)i * stride + k];
  for (int j = 0; j < e->l.rows; j++) for (int k = 0; k <= order; k++) zero += 0 * e->guards[(int64_t)j * stride + k];
  e->finite = zero == 0;
}

/* Multipliers that keep the sliding surfaces of a mode: one step of Newton's method, since they enter
 * linearly, and one against rounding. 0 where there are none. */
static int improve(Run *r, const Layout *l, const double *x, double *unknowns, int steps) {
  int w = r->width, slides = l->slides;
  for (int iteration = 0; slides && iteration < steps; iteration++) {
    double largest = 0, most = 0;
    yardsticks(r, x, held_of(r, l->letter), unknowns);
    double *a = r->work, *b = a + slides * slides;
    for (int i = 0; i < slides; i++) {
      for (int j = 0; j < slides; j++) a[i * slides + j] = r->slope[l->sliding[i] * w + l->sliding[j]];
      b[i] = layer_of(r, l->sliding[i]);
    }
    if (!solve(a, b, slides)) return 0;
    for (int i = 0; i < slides; i++) {
      unknowns[l->sliding[i]] -= b[i];
      largest = larger(fabs(b[i]), largest);
    }
    for (int i = 0; i < w; i++) most = larger(fabs(unknowns[i]), most);
    if (largest <= 1e-16 * (1 + most)) break;
  }
  return 1;
}

/* Numbers: nonsmooth/flow/reference/stepper.py ------------------------------------------------------- */

static double bound(double last, double before, int order) {
  double h = INFINITY;
  if (last > 0) h = pow(last, -1.0 / order);
  if (before > 0) h = smaller(pow(before, -1.0 / (order - 1)), h);
  return h;
}

/* Shorten a step until a guard's series converges within it. */
static double resolve(const double *g, int order, double h) {
  while (h < INFINITY) {
    double power = 1;
    for (int k = 1; k < order; k++) power *= h;
    double last = larger(fabs(g[order]) * h, fabs(g[order - 1])) * power;
    double rest = RESOLVED * (fabs(g[0]) + rest_of(g, order - 2, h));
    if (last <= rest || !(rest > 0 && rest < INFINITY)) break;
    h *= 0.99 * pow(rest / last, 1.0 / (order - 1));
  }
  return h;
}

static double step_size(const Run *r, const Expansion *e) {
  int order = r->order, stride = r->stride;
  double last = 0, before = 0;
  for (int i = 0; i < r->s->dimension; i++) {
    const double *c = e->states + (int64_t)i * stride;
    last = larger(fabs(c[order]) / e->allowed[i], last);
    before = larger(fabs(c[order - 1]) / e->allowed[i], before);
  }
  for (int j = 0; j < e->l.rows; j++) {
    const double *g = e->guards + (int64_t)j * stride;
    double a = e->of_guards[j] + r->o.rtol * fabs(g[0]);
    if (!(a > 0)) continue;
    last = larger(fabs(g[order]) / a, last);
    before = larger(fabs(g[order - 1]) / a, before);
  }
  double h = bound(last, before, order);
  for (int j = 0; j < e->l.rows; j++) {
    const double *g = e->guards + (int64_t)j * stride;
    double a = e->of_guards[j] + r->o.rtol * fabs(g[0]);
    if (!(a > 0) || a > RESOLVED * fabs(g[0])) h = resolve(g, order, h);
  }
  return h;
}

/* A length beyond which the step h that the series allows may not see what comes. */
static double safe_length(const Run *r, const Expansion *e, double h) {
  if (r->s->linear) return INFINITY;
  if (e->l.mode == r->length_mode) return h > GROWTH * r->length ? r->length : INFINITY;
  double natural = INFINITY;
  for (int i = 0; i < r->n; i++) {
    const double *c = e->states + (int64_t)i * r->stride;
    natural = smaller((fabs(c[0]) + r->size) / fabs(c[1]), natural);
  }
  return h > FAR * natural ? FIRST * natural : INFINITY;
}

/* Field (n), errors of the multipliers that slide, and guards at a state and multipliers. */
static void sampled(Run *r, const Expansion *e, const double *x, const double *lam, double *found) {
  int n = r->n, w = r->width, stride = r->stride, slides = e->l.slides;
  set_inputs(r, x, held_of(r, e->l.letter), lam);
  advance_series(r, &e->l, 0);
  for (int i = 0; i < n; i++) *found++ = row_of(r, i)[0];
  for (int i = 0; i < slides; i++, found++) {
    *found = 0;
    for (int j = 0; j < slides; j++) {
      double a = fabs(e->inverse[i * slides + j]);
      if (a != 0) *found += a * fabs(row_of(r, n + e->l.sliding[j])[0]);
    }
  }
  double *g = r->work, *now = g + (int64_t)e->l.rows * stride;
  for (int i = 0; i < w; i++) now[(int64_t)i * stride] = lam[i];
  guard_rows(r, &e->l, now, 1, g);
  for (int j = 0; j < e->l.rows - e->l.branches; j++) *found++ = g[(int64_t)j * stride];
}

/* Whether field and guards at a time of the step are those of the polynomials. */
static int agrees(Run *r, const Expansion *e, double time, double dt) {
  int n = r->n, w = r->width, order = r->order, stride = r->stride, slides = e->l.slides;
  int guards = e->l.rows - e->l.branches, all = n + slides + guards;
  double *x = r->vector, *lam = x + n, *slope = lam + w, ignored;
  double *found = r->sample, *noise = found + all, *moved = noise + all;
  for (int i = 0; i < n; i++) x[i] = horner(e->states + (int64_t)i * stride, order, time, &slope[i]);
  for (int i = 0; i < w; i++) lam[i] = horner(e->series + (int64_t)i * stride, order, time, &ignored);
  sampled(r, e, x, lam, found);
  memset(noise, 0, sizeof(double) * all);
  for (int again = 0; again < 2; again++) {
    int near = 1;
    for (int i = 0; near && i < n; i++)
      near = fabs(found[i] - slope[i]) * dt
             <= WRONG * e->allowed[i] + dt * (VANISHES * fabs(slope[i]) + noise[i]);
    for (int i = n; near && i < n + slides; i++)
      near = found[i] <= WRONG * SAFETY * r->o.rtol + VANISHES + noise[i];
    for (int j = 0; near && j < guards; j++) {
      const double *c = e->guards + (int64_t)j * stride;
      double of_guard = e->of_guards[j] + SAFETY * r->o.rtol * fabs(c[0]);
      double miss = fabs(found[n + slides + j] - horner(c, order, time, &ignored));
      near = miss <= WRONG * of_guard + VANISHES * e->scale[j] + noise[n + slides + j];
    }
    if (near) return 1;
    /* What rounding in the states, and in the time, makes of it: far from zero more than a tolerance. */
    for (int k = 0; k < n && !again; k++) {
      double kept = x[k];
      if (kept == 0) continue;
      x[k] += VANISHES * kept;
      sampled(r, e, x, lam, moved);
      x[k] = kept;
      for (int i = 0; i < all; i++) noise[i] += fabs(moved[i] - found[i]);
    }
  }
  return 0;
}

/* dt where the polynomials agree at the part ``end`` of a step and at points inside, else half of the
 * first point where they do not. */
static double verified(Run *r, const Expansion *e, double dt, double end, double safe) {
  double low = isinf(safe) ? dt : 0.5 * dt;
  if (r->s->linear) return dt;
  while (low > safe) low *= 0.5;
  for (; low < dt; low *= 2)
    for (int k = 0; k < OCTAVE; k++) {
      double s = low * (1 + (double)k / OCTAVE);
      if (!agrees(r, e, s, dt)) return s > TINY ? 0.5 * s : 0;
    }
  for (int k = 1; k <= CHECKS; k++) {
    double s = dt * k / (CHECKS + 1);
    if (!agrees(r, e, s, dt)) return s > TINY ? 0.5 * s : 0;
  }
  return agrees(r, e, end * dt, dt) ? dt : dt > TINY ? 0.5 * dt : 0;
}

/* First coefficient of a guard that is not zero to rounding; order + 1 if there is none. */
static int leading(const Run *r, const Expansion *e, int row, int zeros, double *value) {
  const double *g = e->guards + (int64_t)row * r->stride;
  for (int k = zeros; k <= r->order; k++) {
    double noise = e->scale[row];
    if (k) {
      double speed = 0;
      for (int i = 0; i < r->n; i++) speed = larger(fabs(e->states[(int64_t)i * r->stride + k]), speed);
      noise = e->steep[row] * speed * (k + 1);
    }
    if (fabs(g[k]) > VANISHES * noise) { *value = g[k]; return k; }
  }
  *value = 0;
  return r->order + 1;
}

static double guard_root(const Run *r, const Expansion *e, int row, int drop, double h) {
  const double *g = e->guards + (int64_t)row * r->stride, *c = g + drop;
  int kind = e->l.kind[row];
  if (drop > r->order) return -1;
  if (kind == STOP_GUARD || kind == RESET_GUARD) return first_crossing(c, r->order - drop, h, e->l.side[row]);
  if (c[0] <= 0) {
    double value;
    drop = leading(r, e, row, drop, &value);
    if (value == 0) return -1;
    c = g + drop;
  }
  return first_root(c, r->order - drop, h);
}

/* How far rounding in a guard moves its root; nothing where it has no slope. */
static double blur(const double *c, int order, double dt) {
  double slope, noise = ROOT_ROUNDING * (fabs(c[0]) + rest_of(c, order, dt));
  horner(c, order, dt, &slope);
  slope = fabs(slope);
  return noise < 1e-9 * dt * slope ? noise / slope : 0;
}

static int32_t *side_of(const Run *r, const Layout *l, int row) {
  return r->side + l->index[row] + (l->kind[row] == RESET_GUARD ? r->s->stops : 0);
}

static void note_sides(Run *r, const Expansion *e, double dt) {
  for (int j = 0; j < e->l.rows; j++) {
    if (e->l.kind[j] != STOP_GUARD && e->l.kind[j] != RESET_GUARD) continue;
    const double *g = e->guards + (int64_t)j * r->stride;
    *side_of(r, &e->l, j) = side_before(g, r->order, dt, ON_SURFACE * e->scale[j]);
  }
}

/* Row of the earliest guard to end the mode within h, and the time; -1 if none. */
static int first_hit(const Run *r, const Expansion *e, double h, double *dt) {
  double *time = r->work;
  int first = -1, found = 0, rows = e->l.rows;
  for (int j = 0; j < rows; j++) {
    int kind = e->l.kind[j], at_once = 0;
    const double *g = e->guards + (int64_t)j * r->stride;
    if ((kind == STOP_GUARD || kind == RESET_GUARD) && !r->drop[j]) {
      int side = *side_of(r, &e->l, j);
      at_once = side && passed(g, r->order, side, e->l.side[j]);
    }
    time[j] = at_once ? 0 : guard_root(r, e, j, r->drop[j], h);
    if (time[j] < 0) continue;
    found++;
    if (first < 0 || time[j] < time[first]) first = j;
  }
  int best = first;
  if (found > 1) {
    double near = time[first] + TIE * larger(fabs(r->t), 1)
                  + blur(e->guards + (int64_t)first * r->stride, r->order, time[first]);
    for (int j = 0; j < rows; j++) {
      if (time[j] < 0 || time[j] > near + blur(e->guards + (int64_t)j * r->stride, r->order, time[j])) continue;
      int rank = PRIORITY[e->l.kind[j]], best_rank = PRIORITY[e->l.kind[best]];
      if (rank < best_rank || (rank == best_rank && time[j] < time[best])) best = j;
    }
  }
  if (best >= 0) *dt = time[best];
  return best;
}

/* Surfaces: nonsmooth/model/evaluators.py ---------------------------------------------------------- */

/* Surfaces, gaps and their rates at x; gradients stay among the program's values. */
static const double *surface_values(Run *r, const double *x) {
  const Values *t = &r->s->surfaces;
  values_run(t, x, r->p, r->heights);
  for (int i = 0; i < r->m + 2 * r->c; i++) r->rates[i] = out_of(t, r->heights, i);
  return r->rates;
}

/* Rounding in each of them, times epsilon, after surface_values. */
static const double *surface_scales(Run *r, const double *x) {
  double *near = r->vector, *scale = r->rates + r->m + 2 * r->c;
  for (int i = 0; i < r->n; i++) near[i] = r->size + fabs(x[i]);
  gradient_sums(r, &r->s->surfaces, r->heights, r->m + 2 * r->c, &r->s->surface_gradient, r->m + 2 * r->c, near, 1,
                scale);
  return scale;
}

/* Least-norm Newton steps of the states (not the time) onto functions that are kept at zero: the rows are
 * made orthogonal one after the other, those that can overlap (a dependent row drops out). */
static void project(Run *r, const int32_t *which, int count) {
  const Entries *g = &r->s->surface_gradient;
  int all = r->m + 2 * r->c, nd = r->s->dimension;
  double *rows = r->gradient_row, *size = rows + (int64_t)all * r->n, *residual = size + all;
  for (int iteration = 0; count && iteration < 3; iteration++) {
    int any = 0, k = 0;
    const double *h = surface_values(r, r->x);
    int32_t *place = r->pending, *kept = place + all;
    for (int i = 0; i < all; i++) place[i] = -1;
    for (int i = 0; i < count; i++) { place[which[i]] = i; any |= h[which[i]] != 0; }
    if (!any) break;
    memset(rows, 0, sizeof(double) * count * r->n);
    for (int q = 0; q < g->count; q++)
      if (place[g->row[q]] >= 0 && g->column[q] < nd)
        rows[(int64_t)place[g->row[q]] * r->n + g->column[q]] = out_of(&r->s->surfaces, r->heights, all + q);
    for (int i = 0; i < count; i++) {
      double *row = rows + (int64_t)i * r->n, full = 0;
      for (int l = 0; l < nd; l++) full += row[l] * row[l];
      residual[i] = h[which[i]];
      for (int j = 0; j < k; j++) {
        int other = kept[j];
        if (r->s->component[which[other]] != r->s->component[which[i]]) continue;
        const double *base = rows + (int64_t)other * r->n;
        double s = 0;
        for (int l = 0; l < nd; l++) s += row[l] * base[l];
        s /= size[other];
        for (int l = 0; l < nd; l++) row[l] -= s * base[l];
        residual[i] -= s * residual[other];
      }
      size[i] = 0;
      for (int l = 0; l < nd; l++) size[i] += row[l] * row[l];
      if (size[i] > 1e-24 * full) kept[k++] = i;
    }
    for (int j = 0; j < k; j++) {
      const double *row = rows + (int64_t)kept[j] * r->n;
      double f = residual[kept[j]] / size[kept[j]];
      if (f != 0) for (int l = 0; l < nd; l++) r->x[l] -= f * row[l];
    }
  }
}

/* Functions that a mode keeps at zero: surfaces, gaps and their rates. */
static int kept_by(const Run *r, const int8_t *letter, int32_t *which) {
  int count = 0;
  for (int i = 0; i < r->width; i++) if (letter[i] == 0) which[count++] = i;
  for (int i = r->m; i < r->width; i++) if (letter[i] == 0) which[count++] = i + r->c;
  return count;
}

/* Whether Newton's steps have led onto a surface: not where its zero is a multiple one. */
static int is_on(Run *r, int surface) {
  double h = surface_values(r, r->x)[surface];
  return fabs(h) <= VANISHES * surface_scales(r, r->x)[surface];
}

/* Gaps and rates that are zero to rounding are so, in r->rates. */
static const double *gaps(Run *r, const double *x) {
  surface_values(r, x);
  const double *scale = surface_scales(r, x);
  for (int i = r->m; i < r->m + 2 * r->c; i++) if (fabs(r->rates[i]) <= ON_SURFACE * scale[i]) r->rates[i] = 0;
  return r->rates + r->m;
}

/* Surfaces through the present state, to rounding, and contacts at rest; those that slide in a mode and the
 * ``certain`` one (or -1). The run ends where a gap is negative. */
static void active_surfaces(Run *r, int certain, const int8_t *letter) {
  r->active_count = 0;
  if (!r->width) return;
  surface_values(r, r->x);
  const double *scale = surface_scales(r, r->x), *h = r->rates;
  for (int j = 0; j < r->c; j++) {
    double gap = h[r->m + j];
    if (gap < 0 && !(fabs(gap) <= ON_SURFACE * scale[r->m + j])) finish(r, INCONSISTENT, BEHIND, j);
  }
  for (int i = 0; i < r->width; i++) {
    int rests = fabs(h[i]) <= ON_SURFACE * scale[i];
    if (i >= r->m) rests &= fabs(h[i + r->c]) <= ON_SURFACE * scale[i + r->c];
    if (rests || letter[i] == 0 || i == certain) r->active[r->active_count++] = i;
  }
}

/* Output ----------------------------------------------------------------------------------- */

static void note(Run *r) {
  if (!r->o.dense) return;
  int64_t k = r->out.points++;
  r->out.point_t[k] = r->t;
  memcpy(r->out.point_x + k * r->n, r->x, sizeof(double) * r->n);
}

static void renote(Run *r) {
  if (r->o.dense && r->out.points)
    memcpy(r->out.point_x + (r->out.points - 1) * r->n, r->x, sizeof(double) * r->n);
}

static void enter_segment(Run *r, int mode) {
  Tree *tree = &r->table->tree;
  if (mode == r->segment_mode) return;
  if (r->segment_steps == 0) r->itinerary = tree->node[r->itinerary].parent;
  if (r->itinerary < 0) r->itinerary = 0;
  r->itinerary = tree_child(tree, r->itinerary, mode);
  r->segment_mode = mode;
  r->segment_steps = 0;
}

/* Samples: nonsmooth/flow/section.py */
static void sample(Run *r, double t, const double *x) {
  if (r->kept >= r->room) return;
  r->sample_t[r->kept] = t;
  memcpy(r->sample_x + r->kept++ * r->s->dimension, x, r->s->dimension * sizeof(double));
}

/* Samples at the times from the present one to less than that plus dt. */
static void sample_step(Run *r, const Expansion *e, double dt) {
  double *x = r->vector, ignored;
  while (r->kept < r->room && r->times[r->kept] < r->t + dt) {
    double s = r->times[r->kept] - r->t;
    for (int i = 0; i < r->s->dimension; i++) x[i] = horner(e->states + (int64_t)i * r->stride, r->order, s, &ignored);
    sample(r, r->times[r->kept], x);
  }
}

static void count_hit(Run *r, int kind, int guard, int index, int side, const double *x) {
  const Options *o = &r->o;
  if (!(o->hit_kinds >> kind & 1) || !o->hit_named[guard * o->hit_width + index]) return;
  if ((o->hit_side && side != o->hit_side) || r->t <= r->begun + AT_END * larger(1, fabs(r->begun))) return;
  r->hits++;
  if (r->hits <= o->hit_skip || (r->hits - o->hit_skip) % o->hit_every) return;
  sample(r, r->t, o->hit_after ? r->x : x);
  if (o->hit_count && r->hits >= o->hit_skip + o->hit_every * o->hit_count)
    finish(r, STOPPED, LOOKED_AT, (int)o->hit_count);
}

static void limit_of_events(Run *r);

/* ``x`` is the state at the event, the present one unless the event changed it; ``guard`` a row of the mode
 * before, or -1. */
static void event(Run *r, int kind, int before, int guard, const double *x) {
  r->kinds[kind]++;
  r->event_count++;
  if (kind == r->o.at_kind && r->kinds[kind] == r->o.at_count) {
    r->at_t = r->t;
    memcpy(r->at_x, x, sizeof(double) * r->n);
  }
  if (r->o.dense) {
    int64_t k = r->out.events++;
    r->out.event_kind[k] = kind;
    r->out.event_t[k] = r->t;
    memcpy(r->out.event_x + k * r->n, x, sizeof(double) * r->n);
    memcpy(r->out.event_after_x + k * r->n, r->x, sizeof(double) * r->n);
    r->out.event_before[k] = before;
    r->out.event_after[k] = r->mode;
    r->out.event_guard[k] = guard;
  }
  if (r->o.hit_kinds && guard >= 0) count_hit(r, kind, r->met.kind, r->met.index, r->met.side, x);
  if (r->o.hit_kinds && guard < 0) count_hit(r, kind, IMPACT_GUARD, 0, 0, x); /* impacts that accumulated */
  if (kind == END || kind == STOP) return;
  int at = r->history++ % HISTORY;
  r->interval[at] = r->t - r->last_event;
  r->kind[at] = kind;
  r->pattern[at] = (((int64_t)kind * 4096 + guard + 1) << 40) + ((int64_t)before << 20) + r->mode;
  r->last_event = r->t;
  limit_of_events(r);
  if (r->event_count >= r->o.max_events) finish(r, TOO_MANY_EVENTS, NO_REASON, 0);
}

/* nonsmooth/flow/reference/accumulation.py */
static double interval_back(const Run *r, int back) { return r->interval[(r->history - back) % HISTORY]; }
static int64_t pattern_back(const Run *r, int back) { return r->pattern[(r->history - back) % HISTORY]; }

/* Time left until events accumulate; -1 if they do not (yet). */
static double remaining_time(const Run *r) {
  if (r->history > AT_ONCE) {
    int all_zero = 1;
    for (int k = 1; k <= AT_ONCE; k++) all_zero &= interval_back(r, k) == 0;
    if (all_zero) return 0;
  }
  for (int l = 0; l < LAG_COUNT; l++) {
    int lag = LAGS[l], need = BLOCKS * lag, same = 1;
    if (r->history < need + lag) return -1;
    for (int k = 1; k <= need && same; k++) same = pattern_back(r, k) == pattern_back(r, k + lag);
    if (!same) continue;
    double block[BLOCKS], least = INFINITY, low = INFINITY, high = 0, ratio = 0;
    for (int b = 0; b < BLOCKS; b++) {
      block[b] = 0;
      for (int k = 0; k < lag; k++) block[b] += interval_back(r, need - b * lag - k);
      least = fmin(least, block[b]);
    }
    if (!(least > 0)) continue;
    for (int b = 1; b < BLOCKS; b++) {
      ratio = block[b] / block[b - 1];
      low = fmin(low, ratio);
      high = fmax(high, ratio);
    }
    if (!(high < SHRINKS && high - low <= SPREAD * (1 - ratio))) continue;
    double left = block[BLOCKS - 1] * ratio / (1 - ratio);
    if (left < REMAINING * (r->t - r->begun)) return left;
  }
  return -1;
}

static int come_to_rest(Run *r, double left);

static void limit_of_events(Run *r) {
  double left = remaining_time(r);
  if (left < 0 || (r->status == RUNNING && come_to_rest(r, left))) return;
  r->limit = r->t + left;
  finish(r, ACCUMULATION, NO_REASON, 0);
}

/* Filippov's logic: nonsmooth/flow/reference/switching.py ---------------------------------------------- */

/* Both fields tangent to a surface at the present point, and the sliding field 0/0. */
static int is_two_fold(Run *r, const int8_t *letter, int surface, double tolerance) {
  if (r->s->continuous[surface]) return 0;
  double *near = r->vector + r->n + r->width; /* not where inputs are put together */
  for (int i = 0; i < r->n; i++) near[i] = r->size + fabs(r->x[i]);
  for (int side = 1; side >= -1; side -= 2) {
    held_of(r, letter);
    r->held[surface] = side;
    yardsticks(r, r->x, r->held, r->none);
    if (r->s->scaled[surface] && r->slope[surface * r->width + surface] != 0) return 0;
    gradient_sums(r, &r->s->point, r->point, 2 * r->width + r->s->slope.count, &r->s->layer_gradient, r->width, near,
                  1, r->small);
    double scale = r->small[surface];
    if (!(fabs(layer_of(r, surface)) <= (tolerance + TANGENT) * scale && scale > 0)) return 0;
  }
  return 1;
}

/* Rates of the active surfaces as a + M lambda (reactions open contacts), and their rounding; 0 where they
 * do not decide. a, M, scales one after the other in r->matrix. */
static int rates(Run *r, const int8_t *letter) {
  int k = r->active_count, w = r->width;
  double *a = r->matrix, *m = a + k, *scale = m + (int64_t)k * k, *near = r->vector + r->n + w;
  held_of(r, letter);
  for (int i = 0; i < k; i++) {
    int own = r->active[i];
    r->held[own] = 0;
    if (own >= r->m) continue;
    if (r->s->continuous[own]) return 0;
    for (int j = 0; j < k; j++)
      if (r->active[j] >= r->m && r->s->carries[own * r->c + r->active[j] - r->m]) return 0;
  }
  yardsticks(r, r->x, r->held, r->none);
  for (int i = 0; i < r->n; i++) near[i] = r->size + fabs(r->x[i]);
  gradient_sums(r, &r->s->point, r->point, 2 * w + r->s->slope.count, &r->s->layer_gradient, w, near, 1, r->small);
  for (int i = 0; i < w; i++) if (!(fabs(layer_of(r, i)) < INFINITY)) return 0;
  for (int i = 0; i < k; i++) {
    double turn = r->active[i] < r->m ? 1 : -1;
    if (factor_of(r, r->active[i]) == 0) return 0;
    a[i] = turn * layer_of(r, r->active[i]);
    scale[i] = r->small[r->active[i]];
    for (int j = 0; j < k; j++)
      m[i * k + j] = turn * r->slope[r->active[i] * w + r->active[j]] * factor_of(r, r->active[j]);
  }
  return 1;
}

/* Of a guard that ended the mode before so many coefficients vanish. */
typedef struct { int kind, index, side, zeros; } Known;

/* What is being left has a multiplier at its bound, to the tolerance of the run: its rates decide nothing. */
static int is_left(const Run *r, int which, const Known *known, int count) {
  for (int i = 0; i < count; i++)
    if (known[i].index + (known[i].kind == IMPACT_GUARD || known[i].kind == RELEASE_GUARD ? r->m : 0) == which) return 1;
  return 0;
}

static void many_may_hold(Run *r) { finish(r, NON_UNIQUE, POSSIBLY_SEVERAL, 0); }

static int bits(int a) { return (a & 1) + (a >> 1 & 1) + (a >> 2 & 1); }

/* Number of the modes that are possible, or one more than are tried. */
static int choices_of(const int8_t *possible, int count) {
  int total = 1;
  for (int i = 0; i < count && total <= TRIED; i++) total *= bits(possible[i]);
  return total <= TRIED ? total : TRIED + 1;
}

/* Letters that are possible at the active surfaces, as bits of +1 (1), -1 (2) and sliding (4), for contacts
 * open (1) and closed (4): one where the rates decide, else all. 0 if the run ends. */
static int by_rates(Run *r, const int8_t *letter, const Known *known, int known_count, int8_t *possible) {
  int k = r->active_count, contacts = 0;
  for (int i = 0; i < k; i++) {
    contacts |= r->active[i] >= r->m;
    possible[i] = r->active[i] < r->m ? 7 : 5;
  }
  if (k < 2) return 1;
  int choices = choices_of(possible, k);
  if (!rates(r, letter)) {
    if (choices > TRIED) many_may_hold(r);
    return choices <= TRIED;
  }
  double *a = r->matrix, *m = a + k, *scale = m + (int64_t)k * k;
  if (!shown(m, k, r->work, r->pending)) {
    if (choices > TRIED || (k > FEW && !contacts)) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    return 1;
  }
  int8_t *contact = (int8_t *)(scale + k), *guess = contact + k;
  for (int i = 0; i < k; i++) {
    contact[i] = r->active[i] >= r->m;
    guess[i] = contact[i] ? -letter[r->active[i]] : letter[r->active[i]];
  }
  if (!complementarity(a, m, k, contact, guess, r->lam, r->work, r->pending)) {
    finish(r, INTERSECTION, NO_STABLE_MOTION, 0);
    return 0;
  }
  for (int i = 0; i < k; i++) {
    double rate = a[i], sum = 0, lam = r->lam[i];
    for (int j = 0; j < k; j++)
      if (m[i * k + j] != 0) { rate += m[i * k + j] * r->lam[j]; sum += fabs(m[i * k + j]); }
    double room = contact[i] ? lam : 1 - fabs(lam);
    if (is_left(r, r->active[i], known, known_count)) continue;
    if (room > VANISHES * (1 + scale[i] / fabs(m[i * k + i]))) possible[i] = 4;
    else if (fabs(rate) > VANISHES * (scale[i] + sum)) possible[i] = contact[i] || lam > 0 ? 1 : 2;
  }
  choices = choices_of(possible, k);
  if (choices > TRIED) many_may_hold(r);
  return choices <= TRIED;
}

/* Whether sliding is stable across its layer: 1, 0, or -1 where no simple test shows it. */
static int is_stable(Run *r, const Layout *l) {
  int k = 0, w = r->width;
  for (int i = 0; i < l->slides; i++) k += l->sliding[i] < r->m;
  if (k == 0) return 1;
  double *a = r->matrix;
  int row = 0;
  for (int i = 0; i < l->slides; i++) {
    int column = 0;
    if (l->sliding[i] >= r->m) continue;
    double turn = ns_sign(factor_of(r, l->sliding[i]));
    for (int j = 0; j < l->slides; j++) {
      if (l->sliding[j] >= r->m) continue;
      a[row * k + column++] = turn * r->slope[l->sliding[i] * w + l->sliding[j]];
    }
    row++;
  }
  if (k == 1) return a[0] < 0;
  if (k == 2) return a[0] + a[3] < 0 && a[0] * a[3] - a[1] * a[2] > 0;
  return shown(a, k, r->work, r->pending) == 2 ? 1 : -1;
}

/* Whether the motion can continue in a mode: its guards that vanish here become positive. */
static int continuation(Run *r, const int8_t *letter, const Known *known, int known_count, Continuation *result) {
  Expansion *e = &r->trial;
  lay_out(r, letter, &e->l);
  memset(result->unknowns, 0, sizeof(double) * r->width);
  if (e->l.slides) {
    if (!improve(r, &e->l, r->x, result->unknowns, 1)) return 0;
    yardsticks(r, r->x, held_of(r, letter), result->unknowns);
    int stable = is_stable(r, &e->l);
    if (stable < 0) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    if (!stable) return 0;
  }
  expand(r, letter, r->x, result->unknowns, e);
  if (!e->finite) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  memcpy(result->letter, letter, r->width);
  result->strict = 1;
  memset(result->drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < e->l.rows; row++) {
    int kind = e->l.kind[row], index = e->l.index[row], of = index, active = 0, zeros = 0;
    if (kind == STOP_GUARD || kind == RESET_GUARD) continue;
    if (kind == IMPACT_GUARD || kind == RELEASE_GUARD) of += r->m;
    for (int i = 0; i < r->active_count; i++) active |= r->active[i] == of;
    if (!active) continue;
    for (int i = 0; i < known_count; i++)
      if (known[i].kind == kind && known[i].index == index && known[i].side == e->l.side[row]) zeros = known[i].zeros;
    if (kind == SURFACE_GUARD && zeros < 1) zeros = 1;
    if (kind == IMPACT_GUARD && zeros < 2) zeros = 2;
    double value;
    int k = leading(r, e, row, zeros, &value);
    if (value < 0) return 0;
    if (value == 0) result->strict = 0;
    result->drop[row] = value != 0 ? (k < r->order ? k : r->order) : r->order + 1;
  }
  return 1;
}

static void copy_continuation(const Run *r, Continuation *to, const Continuation *from) {
  memcpy(to->letter, from->letter, r->width);
  memcpy(to->drop, from->drop, sizeof(int32_t) * r->guards);
  memcpy(to->unknowns, from->unknowns, sizeof(double) * r->width);
  to->strict = from->strict;
}

static int rests(const Run *r, const int8_t *letter) {
  for (int i = 0; i < r->width; i++) if (letter[i] == 0) return 1;
  return 0;
}

/* What is to be said of a point without a motion. */
static int no_motion(Run *r, int contacts) {
  if (contacts) finish(r, INCONSISTENT, NO_REACTION, 0);
  else if (r->active_count == 2 && r->n == 2) finish(r, HAND_OVER, NO_REASON, 0); /* orbits may spiral in */
  else if (r->active_count > 1) finish(r, INTERSECTION, NO_STABLE_MOTION, 0);
  else finish(r, HAND_OVER, NO_REASON, 0); /* a degenerate tangency: other programs tell zeros apart */
  return 0;
}

/* Choose, as r->chosen, the motion that continues from a point of the active surfaces; 0 if the run ends.
 * ``letter`` has those of the other surfaces. */
static int decide(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int k = r->active_count, contacts = 0, strict = 0, found = 0, resting = 0, total = 1;
  int8_t *possible = (int8_t *)r->lam + sizeof(double) * r->width, *trial = possible + r->width;
  for (int i = 0; i < k; i++) contacts |= r->active[i] >= r->m;
  if (k == 1 && !contacts && is_two_fold(r, letter, r->active[0], 0)) {
    finish(r, NON_UNIQUE, TWO_FOLD, r->active[0]);
    return 0;
  }
  if (!by_rates(r, letter, known, known_count, possible)) return 0;
  total = choices_of(possible, k);
  r->several_count = 0;
  for (int number = 0; number < total && r->status == RUNNING; number++) {
    int rest = number;
    memcpy(trial, letter, r->width);
    for (int i = k - 1; i >= 0; i--) { /* the last one first, as the reference does */
      int which = rest % bits(possible[i]);
      rest /= bits(possible[i]);
      for (int bit = 0; bit < 3; bit++)
        if (possible[i] >> bit & 1 && which-- == 0) trial[r->active[i]] = bit == 0 ? 1 : bit == 1 ? -1 : 0;
    }
    if (!continuation(r, trial, known, known_count, &r->found)) continue;
    if (r->found.strict && strict++ == 0) copy_continuation(r, &r->one, &r->found);
    if (r->found.strict && r->several_count < SEVERAL) r->several[r->several_count++] = r->trial.l.mode;
    if (found++ == 0) copy_continuation(r, &r->first, &r->found);
    if (rests(r, trial) && resting++ == 0) copy_continuation(r, &r->rest, &r->found);
  }
  if (r->status != RUNNING) return 0;
  if (strict > 1) { finish(r, NON_UNIQUE, AMBIGUOUS, 0); return 0; }
  if (strict == 1) copy_continuation(r, &r->chosen, &r->one);
  else if (found == 1) copy_continuation(r, &r->chosen, &r->first);
  else if (resting) copy_continuation(r, &r->chosen, &r->rest);
  else return no_motion(r, contacts);
  return 1;
}

/* Impacts: nonsmooth/flow/reference/contacts.py ------------------------------------------------------- */

/* One possibility: the contacts ``taking`` an impulse, letters of the surfaces that they carry. The state
 * after it to ``after``; 0 where it contradicts itself. */
static int impulses_fit(Run *r, const double *x, const int32_t *involved, int count, const int32_t *taking, int takes,
                        const int8_t *letter, const int32_t *carried, int carries, const double *target, int plastic,
                        double *after) {
  int m = r->m, w = r->width, k = 0, n = r->n;
  int32_t *unknown = r->pending + 4 * w;
  double *every = r->lam, *a = r->matrix, *b = a + (int64_t)w * w, *limit = b + w, *h = limit + w, *scale = h + w + r->c;
  for (int i = 0; i < carries; i++) if (letter[carried[i]] == 0) unknown[k++] = carried[i];
  int stuck = k;
  for (int i = 0; i < takes; i++) unknown[k++] = m + taking[i];
  yardsticks(r, x, held_of(r, letter), r->none);
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++) a[i * k + j] = r->slope[unknown[i] * w + unknown[j]];
  surface_values(r, x);
  memcpy(scale, surface_scales(r, x), sizeof(double) * (m + 2 * r->c));
  memcpy(h, r->rates, sizeof(double) * m);
  for (int j = 0; j < r->c; j++) h[m + j] = r->rates[m + r->c + j];
  for (int i = 0; i < k; i++) b[i] = i < stuck ? -h[unknown[i]] : target[unknown[i] - m];
  if (!solve(a, b, k)) return 0;
  memset(every, 0, sizeof(double) * w);
  for (int i = 0; i < k; i++) every[unknown[i]] = b[i];
  /* What the impulses change, before r->slope is that of other multipliers. */
  for (int i = 0; i < w; i++)
    for (int j = 0; j < k; j++) if (b[j] != 0) h[i] += r->slope[i * w + unknown[j]] * b[j];
  for (int j = 0; j < r->c; j++) r->held[m + j] = every[m + j]; /* impulses in place of reactions */
  yardsticks(r, x, r->held, r->none);
  for (int i = 0; i < m; i++) limit[i] = fabs(factor_of(r, i));
  for (int i = 0; i < takes; i++) if (!plastic && every[m + taking[i]] < 0) return 0;
  for (int i = 0; i < stuck; i++)
    if (!plastic && fabs(every[unknown[i]]) > limit[unknown[i]] * (1 + 1e-9) + 1e-300) return 0;
  for (int i = 0; i < carries; i++) {
    int own = carried[i];
    if (letter[own] && letter[own] * h[own] < -ON_SURFACE * scale[own]) return 0;
  }
  for (int i = 0; i < count; i++) {
    int j = involved[i], takes_part = 0;
    for (int q = 0; q < takes; q++) takes_part |= taking[q] == j;
    if (!takes_part && h[m + j] < -ON_SURFACE * scale[m + r->c + j]) return 0;
  }
  memcpy(after, x, sizeof(double) * n);
  set_inputs(r, x, held_of(r, letter), r->none);
  values_run(&r->s->columns, r->input, r->p, r->columns);
  const Entries *column = &r->s->column;
  for (int q = 0; q < column->count; q++) {
    double impulse = every[column->column[q]];
    if (impulse != 0) after[column->row[q]] += out_of(&r->s->columns, r->columns, q) * impulse;
  }
  return 1;
}

/* State after the impulses at some closed gaps; 0 if none are consistent. All possibilities are tried, with
 * most contacts and with the present letters first. */
static int strike(Run *r, const int32_t *involved, int count, int plastic, double *after) {
  int m = r->m, c = r->c, carries = 0, choices = 1;
  int32_t *carried = r->pending, *taking = carried + r->width;
  int8_t *letter = (int8_t *)(r->pending + 2 * r->width);
  double *target = r->rates + 2 * (m + 2 * c), *x = r->x;
  const double *h = surface_values(r, x);
  if (!plastic) values_run(&r->s->restitution, x, r->p, r->restitution);
  for (int j = 0; j < c; j++) {
    double rate = h[m + c + j], e = plastic ? 0 : out_of(&r->s->restitution, r->restitution, j);
    target[j] = plastic || !(rate < 0) ? -rate : -(1 + e) * rate;
  }
  for (int i = 0; i < m; i++) {
    int borne = 0;
    for (int q = 0; q < count; q++) borne |= r->s->carries[i * c + involved[q]];
    if (borne) { carried[carries++] = i; choices = choices < 100000 ? 3 * choices : choices; }
  }
  if (count > 12 || choices > 100000) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  for (int size = count; size > 0; size--)
    for (int set = (1 << count) - 1; set > 0; set--) {
      int takes = 0;
      for (int i = 0; i < count; i++) if (set >> (count - 1 - i) & 1) taking[takes++] = involved[i];
      if (takes != size) continue;
      for (int number = 0; number < choices; number++) {
        int rest = number;
        memcpy(letter, r->letter, r->width);
        for (int i = carries - 1; i >= 0; i--, rest /= 3) {
          static const int8_t order[3][3] = {{-1, 0, 1}, {0, 1, -1}, {1, 0, -1}}; /* present, then s + - */
          letter[carried[i]] = order[r->letter[carried[i]] + 1][rest % 3];
        }
        if (impulses_fit(r, x, involved, count, taking, takes, letter, carried, carries, target, plastic, after))
          return 1;
      }
    }
  return 0;
}

/* Events: nonsmooth/flow/reference/driver.py ----------------------------------------------------------- */

static int change_kind(const Run *r, int before, int after) {
  const int8_t *one = r->table->letter + (int64_t)before * r->width;
  const int8_t *two = r->table->letter + (int64_t)after * r->width;
  int closed = 0, slides = 0;
  for (int i = 0; i < r->width; i++)
    if (i < r->m) slides += (two[i] == 0) - (one[i] == 0); else closed += (two[i] == 0) - (one[i] == 0);
  if (closed) return closed > 0 ? CONTACT : RELEASE;
  return slides > 0 ? ENTRY : slides < 0 ? EXIT : CROSSING;
}

static void adopt(Run *r, const Continuation *c) {
  memcpy(r->letter, c->letter, r->width);
  memcpy(r->drop, c->drop, sizeof(int32_t) * r->guards);
  memcpy(r->unknowns, c->unknowns, sizeof(double) * r->width);
  lay_out(r, r->letter, &r->now);
  r->mode = r->now.mode;
  enter_segment(r, r->mode);
}

/* Adopt the mode that continues; 0 where there is none or more than one. */
static int choose(Run *r, const int8_t *letter, const Known *known, int known_count) {
  if (r->active_count) {
    if (!decide(r, letter, known, known_count)) return 0;
  } else {
    memcpy(r->chosen.letter, letter, r->width);
    memset(r->chosen.drop, 0, sizeof(int32_t) * r->guards);
    memset(r->chosen.unknowns, 0, sizeof(double) * r->width);
  }
  adopt(r, &r->chosen);
  return 1;
}

/* Sides of all surfaces; what is on one counts as below until it is decided. Contacts are open. */
static int letters_of(Run *r, int8_t *letter) {
  if (!r->width) return 1;
  const double *h = surface_values(r, r->x);
  int finite = finite_all(h, r->m + 2 * r->c);
  for (int i = 0; i < r->width; i++) letter[i] = i >= r->m || h[i] > 0 ? 1 : -1;
  return finite;
}

/* A closed gap that is closing further is struck at once; one that opens has a known zero. */
static void strike_due(Run *r) {
  if (!r->c || r->status != RUNNING) return;
  const double *gap = gaps(r, r->x), *rate = gap + r->c;
  r->due_impact = -1;
  for (int row = 0; row < r->now.rows; row++) {
    if (r->now.kind[row] != IMPACT_GUARD || gap[r->now.index[row]] != 0) continue;
    if (rate[r->now.index[row]] < 0) r->due_impact = row;
    else if (rate[r->now.index[row]] > 0) r->drop[row] = 1;
  }
}

/* Find the mode of a state that was jumped to. */
static void settle_in(Run *r) {
  letters_of(r, r->start);
  active_surfaces(r, -1, r->start);
  if (r->status != RUNNING) return;
  choose(r, r->start, 0, 0);
  strike_due(r);
}

static void start_in(Run *r, const int8_t *asked) {
  for (int i = 0; i < r->width; i++) {
    int active = 0;
    for (int j = 0; j < r->active_count; j++) active |= r->active[j] == i;
    if (!active && asked[i] != r->letter[i]) { finish(r, HAND_OVER, NO_REASON, 0); return; }
  }
  memset(r->unknowns, 0, sizeof(double) * r->width);
  memcpy(r->letter, asked, r->width);
  lay_out(r, r->letter, &r->now);
  r->mode = r->now.mode;
  if (!improve(r, &r->now, r->x, r->unknowns, 1)) { finish(r, HAND_OVER, NO_REASON, 0); return; }
  Expansion *e = &r->e;
  expand(r, r->letter, r->x, r->unknowns, e);
  for (int row = 0; row < e->l.rows; row++) {
    int kind = e->l.kind[row], active = 0;
    if (kind != SURFACE_GUARD && kind != EXIT_GUARD) continue;
    for (int j = 0; j < r->active_count; j++) active |= r->active[j] == e->l.index[row];
    if (!active) continue;
    double value;
    int k = leading(r, e, row, kind == SURFACE_GUARD, &value);
    r->drop[row] = k;
    if (value < 0) { /* repelling sliding, or a mode that cannot hold: the reference knows which */
      finish(r, HAND_OVER, NO_REASON, 0);
      return;
    }
  }
}

/* After a reset that stays on its zero the motion turns round or passes; or it is pressed. */
static void pass(Run *r, int row, int zeros, double value, int side) {
  int heading = side ? -side : r->now.side[row];
  if (zeros > 1 && value * heading > 0) {
    r->limit = r->t;
    finish(r, ACCUMULATION, PRESSED, r->now.index[row]);
  }
}

/* The state after a reset; the time is kept. */
static void reset_map(Run *r, int index, const double *x, double *after) {
  int nd = r->s->dimension;
  values_run(&r->s->maps, x, r->p, r->maps);
  for (int i = 0; i < nd; i++) after[i] = out_of(&r->s->maps, r->maps, index * nd + i);
  if (r->s->timed) after[nd] = x[nd];
}

/* Whether a start on the zero of a reset is met at once. */
static int is_pressed(Run *r, int row, double value) {
  if (r->now.side[row]) return value * r->now.side[row] > 0;
  double *after = r->at_work, back;
  reset_map(r, r->now.index[row], r->x, after);
  expand(r, r->letter, after, r->unknowns, &r->trial);
  int zeros = leading(r, &r->trial, row, 0, &back), least = zeros < r->drop[row] ? zeros : r->drop[row];
  if (zeros > 0 && (back * value <= 0 || least > 1)) finish(r, NON_UNIQUE, TWO_SIDED, r->now.index[row]);
  return 0;
}

/* The stop or reset, on whose zero the run stands, that is met; ``fired`` is the reset that led here or
 * -1. */
static void arm(Run *r, int fired) {
  int needed = 0;
  r->due = -1;
  if (r->status != RUNNING) return;
  for (int j = 0; j < r->now.rows; j++) needed |= r->now.kind[j] == STOP_GUARD || r->now.kind[j] == RESET_GUARD;
  if (!needed) return;
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  for (int j = 0; j < r->now.rows; j++) {
    int kind = r->now.kind[j], resets = kind == RESET_GUARD, met = 0;
    double value;
    if (kind != STOP_GUARD && !resets) continue;
    r->drop[j] = leading(r, &r->e, j, 0, &value);
    int32_t *kept = side_of(r, &r->now, j), side = *kept;
    if (r->drop[j] == 0) *kept = value > 0 ? 1 : -1; /* where a jump carried it is no passage */
    if (r->drop[j] == 0 || value == 0) continue;
    if (resets && r->now.index[j] == fired) pass(r, j, r->drop[j], value, side);
    else if (resets && r->fired[r->now.index[j]]) continue;
    else if (side) met = side * value < 0 && side * r->now.side[j] <= 0;
    else if (resets) met = is_pressed(r, j, value);
    if (met && (r->due < 0 || PRIORITY[kind] < PRIORITY[r->now.kind[r->due]])) r->due = j;
  }
}

static void begin(Run *r, const int8_t *start_mode) {
  note(r);
  int finite = letters_of(r, r->letter);
  lay_out(r, r->letter, &r->now);
  r->mode = r->now.mode;
  if (!finite) { finish(r, NOT_FINITE, SURFACE, 0); return; }
  active_surfaces(r, -1, r->letter);
  if (r->status == RUNNING) {
    int surfaces = 0;
    while (surfaces < r->active_count && r->active[surfaces] < r->m) surfaces++;
    project(r, r->active, surfaces);
    renote(r);
    if (start_mode) start_in(r, start_mode);
    else if (r->active_count) {
      memcpy(r->start, r->letter, r->width);
      choose(r, r->start, 0, 0);
    }
  }
  enter_segment(r, r->mode);
  strike_due(r);
  arm(r, -1);
}

static void reset(Run *r, int row) {
  double *x = r->before;
  int before = r->mode, index = r->now.index[row];
  memcpy(x, r->x, sizeof(double) * r->n);
  reset_map(r, index, x, r->x);
  if (finite_all(r->x, r->s->dimension)) {
    note(r);
    settle_in(r);
  } else {
    memcpy(r->x, x, sizeof(double) * r->n);
    finish(r, NOT_FINITE, RESET_MAP, index);
  }
  event(r, RESET, before, row, x);
  r->fired[index] = 1;
  arm(r, index);
}

/* Functions that are kept, and gaps that are negative by no more than the tolerance: by what the root's error
 * moves a neighbour. */
static int with_touched(Run *r, int32_t *onto, int kept) {
  int all = kept;
  surface_values(r, r->x);
  const double *scale = surface_scales(r, r->x);
  for (int i = r->m; i < r->m + r->c; i++) {
    int known = 0;
    for (int k = 0; k < kept; k++) known |= onto[k] == i;
    if (!known && r->rates[i] < 0 && r->rates[i] >= -r->o.rtol * scale[i]) onto[all++] = i;
  }
  return all;
}

/* The impulses of a gap that closes, and of the contacts that are closed there. */
static void impact(Run *r, int row) {
  int before = r->mode, contact = r->now.index[row], count = 0;
  int32_t *involved = r->involved, *onto = involved, kept = kept_by(r, r->letter, onto);
  double *x = r->before;
  onto[kept++] = r->m + contact; /* what is closed stays so to rounding */
  project(r, onto, kept);
  int more = with_touched(r, onto, kept);
  if (more > kept) project(r, onto, more);
  renote(r);
  memcpy(x, r->x, sizeof(double) * r->n);
  const double *gap = gaps(r, x), *rate = gap + r->c;
  for (int j = 0; j < r->c; j++) if ((gap[j] == 0 && rate[j] <= 0) || j == contact) involved[count++] = j;
  if (!strike(r, involved, count, 0, r->at_work)) { finish(r, INCONSISTENT, NO_IMPULSE, contact); return; }
  memcpy(r->x, r->at_work, sizeof(double) * r->n);
  note(r);
  settle_in(r);
  event(r, IMPACT, before, row, x);
  arm(r, -1);
}

static void release(Run *r, int row) {
  int before = r->mode, j = r->now.index[row];
  Known known[] = {{RELEASE_GUARD, j, 0, 1}, {IMPACT_GUARD, j, 1, 3}};
  active_surfaces(r, r->m + j, r->letter);
  if (r->status != RUNNING) return;
  memcpy(r->start, r->letter, r->width);
  if (choose(r, r->start, known, 2) && r->mode != before) event(r, change_kind(r, before, r->mode), before, row, r->x);
}

static int advance(Run *r, const Expansion *e, double dt);

/* After impacts that accumulate the contact is closed; whether there is one. */
static int come_to_rest(Run *r, double left) {
  int count = 0, kept = 0;
  int32_t *involved = r->involved, *which = r->involved + r->c;
  if (!r->c) return 0;
  for (int k = 1; k <= 6 && k <= r->history; k++) if (r->kind[(r->history - k) % HISTORY] != IMPACT) return 0;
  const double *gap = gaps(r, r->x);
  for (int j = 0; j < r->c; j++) if (gap[j] == 0) involved[count++] = j;
  if (!strike(r, involved, count, 1, r->at_work)) return 0;
  int before = r->mode;
  memcpy(r->x, r->at_work, sizeof(double) * r->n);
  for (int i = 0; i < count; i++) which[kept++] = r->m + involved[i];
  for (int i = 0; i < count; i++) which[kept++] = r->m + r->c + involved[i];
  project(r, which, kept);
  letters_of(r, r->start);
  for (int i = 0; i < count; i++) which[i] = r->m + involved[i];
  active_surfaces(r, -1, r->start);
  for (int i = 0; i < count; i++) { /* those that rest are so, whatever rounding says */
    int at = 0;
    while (at < r->active_count && r->active[at] < which[i]) at++;
    if (at < r->active_count && r->active[at] == which[i]) continue;
    memmove(r->active + at + 1, r->active + at, sizeof(int32_t) * (r->active_count - at));
    r->active[at] = which[i];
    r->active_count++;
  }
  if (r->status != RUNNING || !choose(r, r->start, 0, 0)) return 1;
  note(r);
  r->history = 0;
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  int closed = 0;
  for (int i = r->m; i < r->width; i++) closed |= r->letter[i] == 0;
  if (closed && r->e.finite && advance(r, &r->e, left)) {
    r->limit = r->t;
    event(r, change_kind(r, before, r->mode), before, -1, r->x);
  }
  return 1;
}

static int only_sliding(const Run *r) {
  int found = -1;
  for (int i = 0; i < r->m; i++) if (r->letter[i] == 0) { if (found >= 0) return -1; found = i; }
  return found;
}

static void watch_two_fold(Run *r) {
  int s = only_sliding(r);
  if (s >= 0 && is_two_fold(r, r->letter, s, r->o.rtol)) finish(r, NON_UNIQUE, SLID_TO_TWO_FOLD, s);
}

static void serve(Run *r, int row) {
  int kind = r->now.kind[row], index = r->now.index[row], side = r->now.side[row], before = r->mode;
  r->met = (Met){kind, index, side};
  if (kind == STOP_GUARD) {
    event(r, STOP, r->mode, row, r->x);
    finish(r, STOPPED, NO_REASON, index);
  } else if (kind == RESET_GUARD) reset(r, row);
  else if (kind == IMPACT_GUARD) impact(r, row);
  else if (kind == RELEASE_GUARD) release(r, row);
  else {
    Known known[] = {{EXIT_GUARD, index, side, 1}, {SURFACE_GUARD, index, side, 2}};
    active_surfaces(r, index, r->letter);
    if (r->status != RUNNING) return;
    int kept = 0; /* contacts among them keep their gaps */
    for (int i = 0; i < r->active_count; i++) r->involved[kept++] = r->active[i];
    project(r, r->involved, kept);
    renote(r);
    if (kind != SURFACE_GUARD) watch_two_fold(r);
    else if (!is_on(r, index)) finish(r, NON_UNIQUE, MULTIPLE_ZERO, index);
    if (r->status != RUNNING) return;
    memcpy(r->start, r->letter, r->width);
    if (choose(r, r->start, known, kind == EXIT_GUARD ? 2 : 0) && r->mode != before)
      event(r, change_kind(r, before, r->mode), before, row, r->x);
  }
}

/* 0 where the state after the step is not finite; the run then ends before it. */
static int advance(Run *r, const Expansion *e, double dt) {
  int n = r->n, stride = r->stride, kept = 0;
  double *x = r->at_work;
  for (int i = 0; i < n; i++) {
    const double *c = e->states + (int64_t)i * stride;
    double v = c[r->order];
    for (int k = r->order - 1; k >= 0; k--) v = v * dt + c[k];
    x[i] = v;
  }
  if (!finite_all(x, n)) { finish(r, NOT_FINITE, STATE, 0); return 0; }
  if (r->o.dense) {
    int64_t k = r->out.steps++;
    r->out.start[k] = r->t;
    r->out.step_mode[k] = r->mode;
    memcpy(r->out.coefficients + k * n * stride, e->states, sizeof(double) * n * stride);
  }
  if (r->times) sample_step(r, e, dt);
  memcpy(r->x, x, sizeof(double) * n);
  r->t += dt;
  r->step_count++;
  r->segment_steps++;
  if (r->s->timed) r->x[n - 1] = r->t;
  kept = kept_by(r, r->letter, r->involved);
  project(r, r->involved, kept);
  if (e->l.slides) {
    double *ahead = r->lam, ignored;
    for (int i = 0; i < r->width; i++) ahead[i] = horner(e->series + (int64_t)i * stride, r->order, dt, &ignored);
    memcpy(r->unknowns, ahead, sizeof(double) * r->width);
    improve(r, &r->now, r->x, r->unknowns, 2);
  }
  memset(r->drop, 0, sizeof(int32_t) * r->guards);
  note(r);
  return 1;
}

static void step(Run *r) {
  if (r->due >= 0) { serve(r, r->due); return; }
  if (r->due_impact >= 0) { serve(r, r->due_impact); return; }
  double left = r->o.t_end - r->t, dt = 0;
  if (left <= 0) { finish(r, REACHED_END, NO_REASON, 0); return; }
  if (r->step_count >= r->o.max_steps) { finish(r, TOO_MANY_STEPS, NO_REASON, 0); return; }
  Expansion *e = &r->e;
  expand(r, r->letter, r->x, r->unknowns, e);
  if (!e->finite) { finish(r, HAND_OVER, NO_REASON, 0); return; }
  double by_series = step_size(r, e), h = smaller(by_series, r->o.max_step);
  if (h <= SHORTEST * larger(fabs(r->t), 1) && h < left) {
    finish(r, STEP_TOO_SMALL, r->shortened > SHORTENED / 10 ? BRANCH_POINT : NO_REASON, 0);
    return;
  }
  int last = h >= left;
  if (last) h = left;
  /* What happens at the end, to rounding, happens. */
  int row = first_hit(r, e, last ? h + AT_END * larger(1, fabs(r->t + h)) : h, &dt);
  dt = row < 0 ? h : smaller(dt, h);
  double wanted = dt, safe = safe_length(r, e, by_series), good;
  while (dt > 0 && (good = verified(r, e, dt, row >= 0 && dt == wanted ? BEFORE_EVENT : JUST, safe)) < dt) dt = good;
  int held = dt > STEADY * r->length && (dt > r->length / STEADY || dt > wanted / FAR);
  int shrinks = dt < wanted && !(r->mode == r->length_mode && held);
  r->shortened = larger(0, r->shortened + (shrinks ? 1 : -0.2));
  r->length_mode = r->mode;
  r->length = dt == wanted ? h : dt;
  int swallowed = dt < wanted && dt <= SHORTEST * fabs(r->t); /* close to t = 0 steps may be tiny */
  if (r->shortened >= SHORTENED || swallowed) { finish(r, STEP_TOO_SMALL, BRANCH_POINT, 0); return; }
  if (dt < wanted) { row = -1; last = 0; }
  if (dt > 0) {
    note_sides(r, e, dt);
    memset(r->fired, 0, sizeof(int32_t) * (r->s->resets + 1));
  }
  last &= dt == h;
  if (!advance(r, e, dt)) return;
  if (last) {
    r->t = r->o.t_end;
    if (r->s->timed) r->x[r->n - 1] = r->t;
    if (r->o.dense) r->out.point_t[r->out.points - 1] = r->t;
  }
  if (row >= 0) serve(r, row);
  else if (!last) watch_two_fold(r);
}

/* The last mode counts only if it lasted for a step (or is the only one). */
static int32_t final_itinerary(const Run *r) {
  int32_t above = r->table->tree.node[r->itinerary].parent;
  return r->segment_steps == 0 && above > 0 ? above : r->itinerary;
}

/* Memory ------------------------------------------------------------------------------------------- */

/* Where ``count`` objects of a size begin; with no base, how far one has come. */
static void *place(char *base, size_t *used, size_t size, size_t count) {
  *used = (*used + 15) & ~(size_t)15;
  void *at = base ? base + *used : 0;
  *used += size * (count + 1);
  return at;
}
#define DOUBLES(count) place(base, &used, sizeof(double), (size_t)(count))
#define INTEGERS(count) place(base, &used, sizeof(int32_t), (size_t)(count))
#define LETTERS(count) place(base, &used, 1, (size_t)(count))

static size_t place_layout(Layout *l, char *base, size_t used, int width, int guards) {
  l->letter = LETTERS(width);
  l->sliding = INTEGERS(width);
  l->kind = INTEGERS(guards);
  l->index = INTEGERS(guards);
  l->side = INTEGERS(guards);
  return used;
}

static size_t place_expansion(Expansion *e, char *base, size_t used, int n, int width, int guards, int stride) {
  used = place_layout(&e->l, base, used, width, guards);
  e->states = DOUBLES(n * stride);
  e->guards = DOUBLES(guards * stride);
  e->series = DOUBLES(width * stride);
  e->allowed = DOUBLES(n);
  e->of_guards = DOUBLES(guards);
  e->scale = DOUBLES(guards);
  e->steep = DOUBLES(guards);
  e->inverse = DOUBLES(width * width);
  return used;
}

static size_t place_continuation(Continuation *c, char *base, size_t used, int width, int guards) {
  c->letter = LETTERS(width);
  c->drop = INTEGERS(guards);
  c->unknowns = DOUBLES(width);
  return used;
}

static size_t place_run(Run *r, char *base) {
  const System *s = r->s;
  int n = r->n, w = r->width, c = r->c, all = r->m + 2 * c, g = r->guards, stride = r->stride;
  size_t used = 0, square = (size_t)w * w, rows = (size_t)(g + w) * stride;
  used = place_layout(&r->now, base, used, w, g);
  used = place_expansion(&r->e, base, used, n, w, g, stride);
  used = place_expansion(&r->trial, base, used, n, w, g, stride);
  Continuation *each[] = {&r->chosen, &r->one, &r->first, &r->rest, &r->found};
  for (int i = 0; i < 5; i++) used = place_continuation(each[i], base, used, w, g);
  r->letter = LETTERS(w);
  r->start = LETTERS(w);
  r->x = DOUBLES(n);
  r->at_x = DOUBLES(n);
  r->before = DOUBLES(n);
  r->at_work = DOUBLES(n);
  r->unknowns = DOUBLES(w);
  r->drop = INTEGERS(g);
  r->side = INTEGERS(s->stops + s->resets);
  r->fired = INTEGERS(s->resets);
  r->active = INTEGERS(w);
  r->involved = INTEGERS(3 * w + 1);
  r->p = DOUBLES(s->parameters);
  r->series = DOUBLES((size_t)s->series.size * stride);
  r->point = DOUBLES(s->point.size);
  r->heights = DOUBLES(s->surfaces.size);
  r->maps = DOUBLES(s->maps.size);
  r->restitution = DOUBLES(s->restitution.size);
  r->columns = DOUBLES(s->columns.size);
  r->input = DOUBLES(n + 2 * w);
  r->held = DOUBLES(w);
  r->none = DOUBLES(w);
  r->slope = DOUBLES(square);
  r->vector = DOUBLES(3 * n + 2 * w);
  r->sample = DOUBLES(3 * ((size_t)n + w + g));
  r->work = DOUBLES(2 * square + 4 * w + rows + g);
  r->gradient_row = DOUBLES((size_t)all * n + 2 * all);
  r->rates = DOUBLES(2 * all + c);
  r->lam = DOUBLES(2 * w);
  r->matrix = DOUBLES(square + 6 * w + all + 2 * c);
  r->small = DOUBLES(3 * w + s->stops + s->resets);
  r->pending = INTEGERS(6 * w + 2 * all);
  r->sparse = INTEGERS(square + 2 * w + 1);
  return used;
}

/* Entry points --------------------------------------------------------------------------------- */

int64_t system_size(void) { return sizeof(System); }
int64_t output_size(void) { return sizeof(Output); }

Run *run_new(const System *s, Table *table) {
  Run *r = calloc(1, sizeof(Run));
  if (!r) return 0;
  r->s = s;
  r->table = table;
  r->n = s->n; r->m = s->m; r->c = s->c; r->width = s->m + s->c;
  r->order = s->order; r->stride = s->order + 1;
  r->guards = 3 * s->m + 2 * s->c + s->stops + s->resets + 2;
  r->arena = calloc(1, place_run(r, 0));
  if (!r->arena) { free(r); return 0; }
  place_run(r, r->arena);
  return r;
}
void run_free(Run *r) { free(r->arena); free(r); }

void run_begin(Run *r, const Options *o, const Output *out, const double *x, const double *p,
               const int8_t *start_mode, double t) {
  const System *s = r->s;
  r->o = *o;
  r->size = o->atol / o->rtol;
  r->out = *out;
  memcpy(r->x, x, sizeof(double) * r->n);
  memcpy(r->p, p, sizeof(double) * s->parameters);
  series_prepare(&s->series, r->stride, r->p, r->series);
  values_prepare(&s->point, r->p, r->point);
  values_prepare(&s->surfaces, r->p, r->heights);
  values_prepare(&s->maps, r->p, r->maps);
  values_prepare(&s->restitution, r->p, r->restitution);
  values_prepare(&s->columns, r->p, r->columns);
  memset(r->unknowns, 0, sizeof(double) * r->width);
  memset(r->drop, 0, sizeof(int32_t) * r->guards);
  memset(r->side, 0, sizeof(int32_t) * (s->stops + s->resets + 1));
  memset(r->fired, 0, sizeof(int32_t) * (s->resets + 1));
  memset(r->kinds, 0, sizeof r->kinds);
  r->step_count = r->event_count = r->segment_steps = r->history = r->hits = r->kept = 0;
  r->itinerary = r->active_count = r->several_count = 0;
  r->length = r->shortened = 0;
  r->t = r->begun = r->last_event = t;
  r->limit = r->at_t = NAN;
  for (int i = 0; i < r->n; i++) r->at_x[i] = NAN;
  r->status = RUNNING;
  r->reason = NO_REASON;
  r->where = 0;
  r->segment_mode = r->due = r->due_impact = r->length_mode = -1;
  if (finite_all(r->x, r->n)) { begin(r, start_mode); return; }
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

void run_read(const Run *r, double *numbers, int64_t *counts, int32_t *active, int32_t *several) {
  numbers[0] = r->t;
  numbers[1] = r->limit;
  numbers[2] = r->at_t;
  int64_t head[] = {r->status, r->reason, r->where, r->mode, final_itinerary(r), r->step_count, r->event_count,
                    r->out.steps, r->out.points, r->out.events, r->active_count, r->several_count};
  memcpy(counts, head, sizeof head);
  memcpy(active, r->active, sizeof(int32_t) * r->active_count);
  memcpy(several, r->several, sizeof(int32_t) * r->several_count);
}

/* Go on with other, empty arrays. */
void run_resume(Run *r, const Output *out) { r->out = *out; }

static void sample_into(Run *r, const Batch *b, int64_t i) {
  r->room = b->room;
  r->times = b->times ? b->times + i * b->times_stride : 0;
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
  for (int j = 0; j < KINDS; j++) b->kinds[i * KINDS + j] = (int32_t)r->kinds[j];
  b->kinds[i * KINDS + END] += r->status != STOPPED;
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
      run_begin(r, o, &none, b->x0 + i * r->n, b->p + i * b->p_stride, start_mode, b->t0);
    }
    *next |= 1;
    if (go_on(r, &budget) == RUNNING) return 1;
    keep(r, b, i);
  }
  return 0;
}

/* Flow of a fixed duration: nonsmooth/flow/fixed.py -------------------------------------------------------- */

/* Step for which the last two terms stay below ``tol`` times the size of their group of states. */
static double group_step(const double *c, int n, int order, const int32_t *group, int groups, double duration,
                         double tol) {
  double h = INFINITY;
  for (int g = 0; g < groups; g++) {
    double size = 0, rate = 0, before = 0, final = 0;
    for (int i = 0; i < n; i++) {
      const double *own = c + (int64_t)i * (order + 1);
      if (group[i] != g) continue;
      size = larger(fabs(own[0]), size);
      rate = larger(fabs(own[1]), rate);
      before = larger(fabs(own[order - 1]), before);
      final = larger(fabs(own[order]), final);
    }
    double allowed = tol * larger(size, rate * duration);
    if (allowed == 0) continue;
    if (final > 0) h = smaller(pow(allowed / final, 1.0 / order), h);
    if (before > 0) h = smaller(pow(allowed / before, 1.0 / (order - 1)), h);
  }
  return h;
}

/* Move z (n) along a smooth field by a duration of either sign; ``work`` has room for the series of the rules
 * and of the states. The time that is left where the field is not finite or steps are too small, else 0. */
double fixed_flow(const Series *t, int32_t n, int32_t order, const int32_t *group, int32_t groups, const double *p,
                  double *z, double duration, double tol, int64_t most_steps, double *work) {
  int stride = order + 1;
  double *s = work, *c = work + (int64_t)t->size * stride, *x = c + (int64_t)n * stride;
  double left = fabs(duration), whole = left, sign = duration < 0 ? -1 : 1;
  memset(s, 0, sizeof(double) * t->size * stride);
  series_prepare(t, stride, p, s);
  for (int64_t step = 0; step < most_steps && left > 0; step++) {
    double zero = 0;
    for (int i = 0; i < n; i++) c[(int64_t)i * stride] = z[i];
    for (int k = 0; k < order; k++) {
      for (int i = 0; i < n; i++) x[i] = c[(int64_t)i * stride + k];
      series_rules(t, t->moving, t->moving_count, k, stride, x, s);
      for (int i = 0; i < n; i++)
        c[(int64_t)i * stride + k + 1] = s[(int64_t)t->output[i] * stride + k] / (k + 1);
    }
    for (int64_t i = 0; i < (int64_t)n * stride; i++) zero += 0 * c[i];
    double h = group_step(c, n, order, group, groups, whole, tol), ignored;
    if (!(h > 1e-14 * whole) || zero != 0) return left;
    /* Two equal steps rather than a long one and the rest of it. */
    if (h >= left) h = left;
    else if (left < 1.5 * h) h = smaller(h, 0.5 * left);
    for (int i = 0; i < n; i++) z[i] = horner(c + (int64_t)i * stride, order, sign * h, &ignored);
    left -= h;
  }
  return left;
}
