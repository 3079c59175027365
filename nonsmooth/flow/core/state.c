/* The driver: all that a run is. The system is data, not code.
 *
 * Read in the order of core_source.py: programs.h, pairs.h, linear.h, state.c (here), modes.c, jets.c, stepper.c,
 * near_zeros.c, elements.c, vectors.c, blocks.c, decide.c, events.c, driver.c; sets.c and approach.c are how sets of
 * codimension two and more move and are met.
 */


/* Entries of a sparse matrix in the order of a program's outputs. */
typedef struct { int32_t count, pad; const int32_t *row, *column; } Entries;

/* Conditions of stops and resets; ``trigger_at``, ``filter_at`` and ``value_at`` say where each begins. */
typedef struct {
  int32_t atoms, triggers, clocks, discrete, keeps, width; /* keeps: states when due are kept; width: of a motion */
  const int32_t *way; /* how each atom is located: falling, either way, rising, UNWATCHED */
  const int32_t *trigger_event, *trigger_at, *condition, *filter_at, *filter, *flags, *initially, *named;
  const int32_t *clock_reset, *clock_state, *value_at;
  const double *value; /* of discrete states */
} Rules;

/* An element: k functions that stand side by side from ``first``, with a multiplier each, and the law between them
 * (elements.c); each function has the entry of its element. The multiplier enters derivative ``degree`` of h; those
 * between are rows from ``lower`` on of what is kept: all functions, then these. With hysteresis h is that of the
 * multiplier +1, and the row ``lower`` that of -1. */
typedef struct {
  int32_t law, first, k, degree, lower, flags;
  double width, power; /* of the layer; the smallest power of h in the field, or 0 */
} Element;

/* Flags: the multiplier makes no difference on h = 0; its unknown is a product with a factor. */
enum { CONTINUOUS = 1, SCALED = 2 };

typedef struct {
  int32_t n, dimension, timed, m, c, parameters, stops, resets, order, slope_outputs;
  Series series;      /* field, layer, surfaces and gaps, factors, stops and resets, slope_outputs slopes */
  Series free;        /* the same rules where nothing slides: field, surfaces and gaps, stops and resets */
  Values point;       /* layer, factors, entries of slope, gradients of layer, surfaces and gaps, stops, factors */
  Values surfaces;    /* surfaces, gaps, rates of gaps; entries of their gradients */
  Values maps;        /* states after each reset */
  Values atoms;       /* guards of stops and resets, further functions of conditions; entries of their gradients */
  Values choices;     /* filters and priorities of stops and resets, periods of clocks */
  Values restitution; /* of each impact */
  Values columns;     /* entries of the field's derivatives by the unknowns */
  Entries slope, layer_gradient, height_gradient, stop_gradient, factor_gradient, surface_gradient, atom_gradient, column;
  const Element *element; /* of each function: of m surfaces and sets, c contacts */
  const int32_t *carries, *component; /* (m, c): contacts whose reaction scales a surface's multiplier */
  /* (m + c, m + c): output of the series or -1; whether it moves; whether the matrix is symmetric */
  const int32_t *slope_output, *slope_moves, *slope_symmetric;
  int32_t linear, linear_free; /* whether field and guards are affine: in any mode, where nothing slides */
  /* Field's rows in any mode, where nothing slides; surfaces and gaps, stops and resets: 0 if affine, with sines of
   * the time, nothing to be checked; the latter: 0 if affine in states and time, polynomials are exact. */
  const int32_t *bent, *bent_free, *bent_guards, *curved;
  int32_t affine; /* whether all unknowns enter linearly together */
  /* sets: of codimension two and more; kept_rows: see Element; combined: conditions whose rows are sums (hidden.c) */
  int32_t sets, kept_rows, impact_law, joints, combined;
  const int32_t *mixed; /* (m + c, m + c): pairs of unknowns that do not enter linearly together */
  Rules rules;
  Entries derivatives; /* of field, layer, surfaces and gaps, factors by what moves and parameters; see variation.c */
  const Series *implicit; /* with those derivatives, for implicit steps, or none */
  const int32_t *places; /* states in an order in which what is coupled is close, or none */
} System;

enum { GERM = 3 }; /* coefficients by which a motion is seen to go on as it arrived */

/* What happens at one time (events.c). Of atoms: sides, as the jumps have made them, as evaluated now; those that are
 * passed or zero; values, rounding in them, errors of their roots. Of conditions: whether due, whether true before,
 * whether true at the start and not met since. */
typedef struct {
  int32_t running, first, settled, unsettled, last, tied, is_last;
  int64_t jumps, counted, sampled, *count;
  int8_t *side, *view, *now, *passing, *zero, *pending, *was, *unmet;
  double *value, *noise, *residual, *germ, *trigger_x, *arrived, *tick; /* two numbers each; germ: first coefficients on arrival */
} Instant;

/* The guards of a mode, and what slides in it. */
typedef struct {
  int8_t *letter; /* +1, -1, 0 for each surface; +1, 0 for open and closed contacts; see below */
  int32_t rows, atoms, slides, mode, branches, is_free; /* atoms: first row of stops and resets; free: no letter is 0 */
  int32_t *sliding, *group, *kind, *index, *side, *bent, bent_count; /* bent: guards that a step is checked with */
} Layout;

typedef struct {
  Layout l;
  int finite, scaled, steepened; /* whether scale and steep are known */
  int64_t stamp; /* of the values of the program ``point`` */
  double *states, *guards, *series, *allowed, *of_guards, *scale, *steep, *inverse;
  /* of sets: multipliers, h in units of |h|, its root, distances when leaving, slopes then, |h| at the start */
  double *lambda, *apart, *root, *rates, *slopes, *radius, *per_radius;
  const double *end; /* the state at the end of an implicit step, or none */
} Expansion;

/* A mode that can continue, and the zeros of its guards. */
typedef struct { int8_t *letter; int32_t strict, *drop; double *unknowns; } Continuation;

/* A motion that can continue from a point: states of the active elements, the orders at which they were decided, the
 * states before, the unknowns; first terms of the states' series. */
typedef struct { int8_t *state, *order, *before; int32_t terms; double *nu, *series; } Motion;

/* The law of the active elements at a point; see decide.c. Matrices are (count, count), what has orders is
 * (orders, count). */
typedef struct {
  int32_t count, blocks, motions, branches, unstable, last; /* last: order that growth decides instead of coefficients */
  int32_t is_imposed; /* whether states are given: those of a mode */
  const int8_t *letter;
  /* Of vectors: rows of each, as in Block; the order at which their law is posed; directions u and speeds s of what
   * leaves, by orders; axes. ``base`` has letters in which they are held. */
  int8_t *base, *span, *began;
  double *along, *speed, *axes;
  int32_t *own, *order, *first, *mark, *pivot, *proved;
  int8_t *is_contact, *is_idle, *is_touched, *is_known, *state, *block_state, *large_class;
  double *matrix, *share, *bound, *joint, *through, *a, *b, *nu, *floor, *turn, *sign, *old, *yard, *room, *steep, *block, *large, *work;
  double most, field, rate;
  Motion motion[SEVERAL];
} Decision;

/* Equations of the states alone that closed conditions leave (hidden.c): letters of the mode for which rows are
 * combined, and what for; how many of those that are closed depend on others; numbers of the rows that are combined;
 * slopes of all conditions by the unknowns, gradients of their functions, the part by which dropped slopes are off. */
typedef struct { int8_t *letter; int32_t kind, is_raw, is_known, dependent, count, *row, *own, *mark; double *slope, *gradient, *work, off; } Equations;

/* Modes met, by number: their letters. */
typedef struct { Tree tree; int32_t width, count, room; int8_t *letter; int32_t *bucket, buckets; } Table;

/* What a run writes, when dense: steps, points and events, into arrays that the caller makes larger when full. */
typedef struct {
  int64_t steps, points, events, step_room, point_room, event_room;
  double *start, *coefficients, *point_t, *point_x, *event_t, *event_x, *event_after_x, *event_motion;
  int32_t *step_mode, *event_kind, *event_before, *event_after, *event_guard;
} Output;

/* The guard that is served. */
typedef struct { int kind, index, side; } Met;

/* An event that may be one of many that accumulate: the time since the one before, and what was served. */
typedef struct { double interval; int64_t pattern; int32_t kind; Met met; } Happened;

typedef struct Implicit Implicit; /* implicit.c */

typedef struct {
  Options o;
  const System *s;
  Table *table;
  double *p;
  int32_t n, m, c, width, order, stride, guards, kept_rows; /* the last: surfaces, gaps, their rates, lower derivatives */
  /* The time is t + t_low: that of an event is no number of its own where times are large. */
  Pair begun;
  double t, t_low, since, limit, at_t, *x, *at_x, *unknowns;
  const int8_t *remembered; /* letters from which elements with hysteresis go on, or none */
  int8_t *letter, *start, *tried_letter; /* present ones, and those that a choice is made from */
  double *tried, *solutions, *of_defect; /* unknowns that enter nonlinearly; errors of guards */
  Layout now; /* of the present mode */
  Met met;
  Instant instant;
  int32_t mode, status, reason, where, due_impact, falls, repelling, folded, *drop;
  int64_t step_count, implicit_count, event_count, kinds[KINDS], segment_steps, history;
  int32_t itinerary, segment_mode, prepared; /* prepared: whether the parameters are known, in lanes */
  Happened past[HISTORY];
  double size, time_size, length, shortened, held_length, hold; /* hold: the step's end before zeros of a guard that are not told apart */
  int32_t over, length_mode, active_count, several_count, several[SEVERAL], *active;
  Expansion e, trial;
  Continuation chosen, one, first, rest, found;
  Decision *decision;
  int32_t facts, dependent; /* about the decisions of a run; the last mode whose unknowns are not unique */
  int32_t turned_mode; /* the mode of start_mode, whose guards of stability begin with these signs */
  int8_t *turned;
  double *layer_series, *rates_of_several;
  Output out;
  int64_t stamp, hits, kept, room; /* of the section; samples kept, in row of the results */
  const double *times, *read_at; /* times of samples in the row; times at which any run is read */
  int64_t read_count;
  double *sample_t, *sample_x;
  /* programs' values, inputs, error scales */
  double *series, *rounding, *point, *heights, *maps, *restitution, *columns, *input, *held, *none, *slope;
  double *vector, *sample;
  double *atom_work, *choice_work;
  double *met_at, *hidden; /* root of each guard in the step, or -1; how long before it rounding may hide its zero */
  double t_error; /* the largest of those of events that move a state by more than the tolerance */
  double *before, *at_work, *work, *gradient_row, *rates, *lam, *matrix, *small;
  int32_t *pending, *sparse, *involved;
  /* of sets: multipliers, whether they move, room; the mode that is shown, the expansion that guards are made of */
  double *direction, *later, *aside, *heights_of;
  double *saved, *speed, *at_root; /* a state to return to; of each surface at its last zero */
  double *jumped_from, *jump_work; /* the state before the last jump of complementarity conditions */
  int8_t *moving, *key, *idle, *vanishes; /* sets without friction; nodes of a program that are zero */
  Equations equations;
  int32_t shown, has_roots, held_steps, wants_program; /* held_steps: steps in a row that a decay rate held */
  Implicit *implicit;
  const Expansion *expansion;
  void *arena;
} Run;

/* What a state has at least where rounding is weighed: of one, and of the time. */
static double size_of_state(const Run *r, int i) { return i < r->s->dimension ? r->size : r->time_size; }
static double unit_of_state(const Run *r, int i) { return i < r->s->dimension ? 1 : r->time_size / r->size; }

/* Sums over the states of |gradient| times a vector: of layer, surfaces and gaps, stops and resets, factors; of
 * surfaces, gaps, stops and resets only where nothing slides. */
typedef struct { double *layer, *height, *stop, *factor; } Sums;

/* What a law says of its elements. ``i`` is the first function of an element, rows are those of its own guards. */
typedef struct {
  void (*lay_out)(const Run *r, Layout *l, int i); /* guards of a mode */
  void (*guard)(Run *r, const Layout *l, int row, const double *series, int count, double *g); /* their series */
  double (*rounding)(Run *r, const Expansion *e, int row, const Sums *of); /* in the guard of a row */
  int8_t (*side)(const Run *r, int i, double h); /* letter off its zero, where it has two by the present one */
  void (*serve)(Run *r, int row); /* at the zero of a guard */
} Law;

static const Law *law_of(const Run *r, int i);
static void add_branches(const Run *r, Layout *l);
static double branch_scale(const Run *r, const Layout *l, int row);
static void branch_row(const Run *r, const Layout *l, int row, int count, double *g);
static void aim(Run *r, const int8_t *letter, const double *x, const double *unknowns);
static void aim_again(Run *r, const Expansion *e);
static void begin_sets(Run *r, Expansion *e, const double *unknowns);
static int begin_directions(Run *r, Expansion *e);
static void follow_sets(Run *r, Expansion *e, int k);
static void leave_sets(Run *r, Expansion *e, int k);
static void close_sets(Run *r, Expansion *e, int k);
static void direction_bounds(const Run *r, const Expansion *e, double *last, double *before);
static double slip_root(const Run *r, const Expansion *e, int row, double dt, double h);
static void measure_limits(Run *r, Expansion *e);
static void keep_carried(const Run *r, const int8_t *letter, double *unknowns);

static void finish(Run *r, int status, int reason, int where) {
  if (r->status == RUNNING) { r->status = status; r->reason = reason; r->where = where; }
}

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
  for (int32_t k = 0; parent && k < t->tree.size; k++) {
    parent[k] = t->tree.node[k].parent;
    mode[k] = t->tree.node[k].mode;
  }
  if (letter) memcpy(letter, t->letter, (size_t)t->count * t->width);
}
void table_free(Table *t) { free(t->tree.node); free(t->letter); free(t->bucket); free(t); }
