/* Data structures of the driver: systems, runs and decisions. The system is data, not code.
 *
 * Read in the order of core_source.py: programs.h, pairs.h, linear.h, state.c (here), modes.c, jets.c, stepper.c,
 * near_zeros.c, elements.c, vectors.c, blocks.c, decide.c, events.c, driver.c; sets.c and approach.c treat sets of
 * codimension two and more.
 */

/* Entries of a sparse matrix in the order of a program's outputs. */
typedef struct { int32_t count, pad; const int32_t *row, *column; } Entries;

/* Conditions of stops and resets; ``trigger_at``, ``filter_at`` and ``value_at`` are their offsets. */
typedef struct {
  int32_t atoms, triggers, clocks, discrete, keeps, width; /* keeps: states when due are kept; width: of a motion */
  const int32_t *way; /* how each atom is located: falling, either way, rising, UNWATCHED */
  const int32_t *trigger_event, *trigger_at, *condition, *filter_at, *filter, *flags, *initially, *named;
  const int32_t *clock_reset, *clock_state, *value_at;
  const double *value; /* of discrete states */
} Rules;

/* An element: k functions from ``first`` on, with a multiplier each, and their law (elements.c); each function has the entry
 * of its element. The multiplier enters derivative ``degree`` of h; lower derivatives are rows from ``lower`` on of the
 * functions kept at zero: all functions, then these. With hysteresis h is that of the multiplier +1, and the row ``lower``
 * that of -1. */
typedef struct {
  int32_t law, first, k, degree, lower, flags, shown, pad; /* shown: the number of the function in results */
  double width, power; /* of the layer; the smallest power of h in the field, or 0 */
} Element;

/* A table: ``count`` breakpoints of its function, and for each cell between them the values of ``size`` parameters from
 * ``first`` on. The number of each breakpoint in results, or -1. Of each limit the first and the last cell, and the number
 * of surfaces with the sides on which it applies. */
typedef struct {
  int32_t count, size, first, limits;
  const double *level, *value;
  const int32_t *shown, *limit;
} Cells;

/* Flags: the multiplier does not act on h = 0; its unknown is a product with a factor. */
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
  const Cells *cells; /* of each function, where it is a table's */
  const int32_t *carries, *component; /* (m, c): contacts whose reaction scales a surface's multiplier */
  /* (m + c, m + c): output of the series or -1; whether it moves; whether the matrix is symmetric */
  const int32_t *slope_output, *slope_moves, *slope_symmetric;
  int32_t linear, linear_free; /* whether field and guards are affine: in any mode, where nothing slides */
  /* Field's rows in any mode, where nothing slides; surfaces and gaps, stops and resets: 0 if affine, with sines of
   * the time, nothing to be checked; the latter: 0 if affine in states and time, polynomials are exact. */
  const int32_t *bent, *bent_free, *bent_guards, *curved;
  int32_t affine; /* whether all unknowns enter linearly together */
  /* sets: of codimension two and more; kept_rows: see Element; combined: conditions whose rows are sums (hidden.c) */
  int32_t sets, kept_rows, impact_law, joints, tables, combined;
  const int32_t *mixed; /* (m + c, m + c): pairs of unknowns that do not enter linearly together */
  Rules rules;
  Entries derivatives; /* of field, layer, surfaces and gaps, factors by what moves and parameters; see variation.c */
  const Series *implicit; /* with those derivatives, for implicit steps, or none */
  const int32_t *ordering; /* states in an order in which what is coupled is close, or none */
} System;

enum { GERM = 3 }; /* coefficients that show whether a motion continues as it arrived */

/* Arrays of a structure: one list declares them with their sizes, and allocates them (entry.c). */
#define DECLARED(type, name, count) type *name;

/* Events at one time (events.c). Of atoms: sides, after the jumps and as evaluated now; whether passed or zero; values,
 * rounding in them, errors of their roots. Of conditions: whether due, whether true before, whether true at the start and
 * not fired since. */
typedef struct {
  int32_t running, first, settled, unsettled, last, tied, is_last;
  int64_t jumps, counted, sampled;
#define INSTANT_ARRAYS(OF) \
  OF(int8_t, side, atoms) OF(int8_t, view, atoms) OF(int8_t, now, atoms) OF(int8_t, passing, atoms) \
  OF(int8_t, zero, atoms) OF(int8_t, pending, triggers) OF(int8_t, was, triggers) OF(int8_t, unfired, triggers) \
  OF(double, value, atoms) OF(double, noise, atoms) OF(double, residual, atoms) \
  OF(double, germ, GERM * atoms) /* first coefficients on arrival */ \
  OF(double, trigger_x, s->rules.keeps ? triggers * s->n : 0) OF(double, arrived, s->n) \
  OF(double, tick, 2 * clocks) OF(int64_t, count, clocks) /* ticks are two numbers each */
  INSTANT_ARRAYS(DECLARED)
} Instant;

/* The guards of a mode, and its sliding functions. */
typedef struct {
  int32_t rows, atoms, slides, mode, branches, is_free; /* atoms: first row of stops and resets; free: no letter is 0 */
  int32_t bent_count;
#define LAYOUT_ARRAYS(OF) /* letter: +1, -1, 0 for each surface; +1, 0 for open and closed contacts; see below */ \
  OF(int8_t, letter, width) OF(int32_t, sliding, width) OF(int32_t, group, width) \
  OF(int32_t, kind, guards) OF(int32_t, index, guards) OF(int32_t, side, guards) \
  OF(int32_t, bent, guards) /* guards that a step is checked with */
  LAYOUT_ARRAYS(DECLARED)
} Layout;

typedef struct {
  Layout l;
  int finite, scaled, steepened, entries; /* whether scale and steep are known; entries: of the inverse */
  int64_t stamp; /* of the values of the program ``point`` */
#define EXPANSION_ARRAYS(OF) \
  OF(double, states, n * stride) OF(double, guards, rows * stride) OF(double, series, width * stride) \
  OF(double, allowed, n) OF(double, of_guards, rows) OF(double, scale, rows) OF(double, steep, rows) \
  /* the inverse of the layer's slope: nonzero entries of each row of those that slide, from ``from`` to ``to`` */ \
  OF(double, inverse, width * width) OF(int32_t, column, width * width) OF(int32_t, from, width) OF(int32_t, to, width) \
  /* of sets: multipliers, h in units of |h|, its root, distances when leaving, slopes then, |h| at the start */ \
  OF(double, lambda, of_sets * stride) OF(double, apart, of_sets * stride) OF(double, root, sets * stride) \
  OF(double, rates, sets * (stride + 1)) OF(double, slopes, of_sets * width) OF(double, radius, sets) \
  OF(double, per_radius, sets)
  EXPANSION_ARRAYS(DECLARED)
  const double *end; /* the state at the end of an implicit step, or none */
} Expansion;

/* An admissible mode, and the zeros of its guards. */
typedef struct {
  int32_t strict;
#define CONTINUATION_ARRAYS(OF) OF(int8_t, letter, w) OF(int32_t, drop, rows) OF(double, unknowns, w)
  CONTINUATION_ARRAYS(DECLARED)
} Continuation;

/* An admissible motion from a point: states of the active elements, the orders that decided them, the states before, the
 * unknowns; first terms of the states' series. */
typedef struct { int8_t *state, *order, *before; int32_t terms; double *nu, *series; } Motion;

/* The law of the active elements at a point; see decide.c. Matrices are (count, count), arrays with orders (orders, count). */
typedef struct {
  int32_t count, blocks, motions, branches, unstable, last; /* last: order that growth decides instead of coefficients */
  int32_t is_imposed, is_shared; /* whether states are given: those of a mode; whether bounds depend on reactions */
  int32_t ending, ended; /* a block (from 1) that holds up to this instant, and the last whose limit was found */
  const int8_t *letter;
#define DECISION_ARRAYS(OF) /* Lemke's method on one block of all elements needs most of them */ \
  OF(int32_t, own, w) OF(int32_t, order, w) OF(int32_t, first, w + 1) OF(int32_t, mark, 4 * w) \
  OF(int32_t, pivot, 8 * w + 8) OF(int32_t, proved, w) \
  /* columns of the nonzero entries of each row of the law, ascending; the place of each element in the order of blocks */ \
  OF(int32_t, link_at, w + 1) OF(int32_t, link, w * w) OF(int32_t, place, w) \
  OF(int8_t, is_contact, w) OF(int8_t, is_idle, w) OF(int8_t, is_touched, w) OF(int8_t, is_known, w) \
  OF(int8_t, state, orders + w) OF(int8_t, block_state, 4 * w) OF(int8_t, large_class, w) \
  /* of vectors: letters in which they are held, rows of each, as in Block; the order at which their law is posed; \
   * directions u and speeds s of what leaves, by orders; axes */ \
  OF(int8_t, base, w) OF(int8_t, span, w) OF(int8_t, began, w) \
  OF(double, along, orders) OF(double, speed, orders) OF(double, axes, 3 * w) \
  OF(double, matrix, w * w) OF(double, share, w * w) OF(double, bound, orders) OF(double, joint, w * w) \
  OF(double, through, w * w) OF(double, a, orders) OF(double, b, orders) OF(double, nu, orders) \
  OF(double, floor, orders) OF(double, turn, w) OF(double, sign, w) OF(double, old, w) OF(double, yard, w) \
  OF(double, room, w) OF(double, steep, w) OF(double, block, 6 * w * w + 8 * w) OF(double, large, w) \
  OF(double, work, 90 * w * w + 90 * w + 64)
  DECISION_ARRAYS(DECLARED)
  double most, field, rate;
  Motion motion[SEVERAL];
} Decision;

/* Equations of the states alone from closed conditions (hidden.c): letters of the mode of the combined rows, and their kind;
 * the number of dependent closed conditions; numbers of the combined rows; slopes of all conditions by the unknowns,
 * gradients of their functions, the relative error of dropped slopes. */
typedef struct {
  int32_t kind, is_raw, is_known, dependent, count;
  double off;
#define EQUATION_ARRAYS(OF) \
  OF(int8_t, letter, w) OF(int32_t, row, q) OF(int32_t, own, q) OF(int32_t, mark, 3 * q + w) OF(double, slope, q * w) \
  OF(double, gradient, q * n) OF(double, work, q ? 2 * q * q + 2 * q * w + w + q : 0)
  EQUATION_ARRAYS(DECLARED)
} Equations;

/* Letters of modes, by number. */
typedef struct { Tree tree, leaves; int32_t width, count, room; int8_t *letter; } Table;

/* Dense output of a run: steps, points and events, in arrays that the caller enlarges when full. */
typedef struct {
  int64_t steps, points, events, step_room, point_room, event_room;
  double *start, *coefficients, *point_t, *point_x, *event_t, *event_x, *event_after_x, *event_motion;
  int32_t *step_mode, *event_kind, *event_before, *event_after, *event_guard;
} Output;

/* The guard of the present event. */
typedef struct { int kind, index, side; } Guard;

/* A guard that ended the previous mode, and the number of its vanishing coefficients. */
typedef struct { int kind, index, side, zeros; } Known;

/* An event for the detection of accumulation: the time since the one before, and its guard. */
typedef struct { double interval; int64_t pattern; int32_t kind; Guard guard; } Happened;

typedef struct Implicit Implicit; /* implicit.c */

typedef struct {
  Options o;
  const System *s;
  Table *table;
  int32_t n, m, c, width, order, stride, guards, kept_rows; /* the last: surfaces, gaps, their rates, lower derivatives */
  /* The time is t + t_low: double-double, as events need for large times. */
  Pair begun;
  double t, t_low, limit, at_t;
  const int8_t *remembered; /* initial letters of elements with hysteresis, or none */
  Layout now; /* of the present mode */
  Instant instant;
  int32_t mode, status, reason, due_impact, falls, folded, passed; /* passed: the breakpoint */
  int32_t segment_mode, length_mode, prepared; /* prepared: whether the parameters are known, in lanes */
  /* Zero where a run begins, up to ``past``: held_steps counts consecutive steps that a decay rate limited; facts describe the
   * decisions; t_error is the largest ``hidden`` of events that move a state by more than the tolerance. */
  double since, length, shortened, held_length, t_error;
  int64_t step_count, implicit_count, event_count, kinds[KINDS], segment_steps, history, hits, kept;
  int32_t where, itinerary, over, active_count, several_count, facts, held_steps, wants_program;
  int32_t expanded; /* whether e may be the expansion of the present state */
  Guard guard;
  Happened past[HISTORY];
  int32_t several[SEVERAL];
  double size, time_size, hold; /* hold: the step's end before unresolved zeros of a guard */
  Expansion e, trial;
  Continuation chosen, found;
  Decision *decision;
  int32_t dependent; /* the last mode whose unknowns are not unique */
  int32_t turned_mode; /* the mode of start_mode, whose guards of stability begin with the signs ``turned`` */
  Output out;
  int64_t stamp, room; /* of the section, and samples kept: in the row of the results */
  const double *times, *read_at; /* times of samples in the row; sample times of any run */
  int64_t read_count;
  double *sample_t, *sample_x;
  Equations equations;
  int32_t shown, has_roots;
  Implicit *implicit;
  const Expansion *expansion;
  void *arena;
#define RUN_ARRAYS(OF) \
  OF(int8_t, letter, w) OF(int8_t, start, w) /* present letters, and those at the start of a decision */ \
  OF(double, x, n) OF(double, at_x, n) OF(double, before, n) OF(double, saved, n) /* saved: to return to */ \
  OF(double, jumped_from, n) /* the state before the last jump of complementarity conditions */ \
  OF(double, jump_work, jumping ? n * (2 * n + jumping + 1) : 0) \
  OF(double, speed, w) OF(double, at_root, 3 * n) OF(double, at_work, n) /* speed: of each at its last zero */ \
  OF(double, unknowns, w) OF(double, tried, w) OF(double, solutions, SOLUTIONS * w) /* that enter nonlinearly */ \
  OF(int8_t, tried_letter, 2 * w) OF(int32_t, drop, rows) OF(int32_t, active, w) \
  OF(int32_t, involved, 3 * w + 4 * all + q + 1) \
  /* programs' values, inputs, error scales */ \
  OF(double, p, s->parameters + 2 * q * q) OF(double, series, series_room(&s->series, stride)) \
  OF(double, rounding, s->series.size * stride) OF(double, point, pair_room(s->point.size, 1)) \
  OF(double, heights, pair_room(s->surfaces.size, 1)) OF(double, maps, pair_room(s->maps.size, 1)) \
  OF(double, restitution, pair_room(s->restitution.size, 1)) OF(double, columns, pair_room(s->columns.size, 1)) \
  OF(double, input, n + 2 * w) OF(double, held, w) OF(double, none, w) OF(double, slope, w * w) \
  OF(double, vector, 3 * n + 2 * w) OF(double, sample, 3 * (n + w + rows)) \
  OF(double, work, 6 * w * w + 8 * w + (rows + w) * stride + rows) OF(double, gradient_row, (all + q) * n + 2 * (all + q)) \
  OF(double, rates, 2 * all + 2 * c) OF(double, lam, 2 * w) OF(double, matrix, w * w + 9 * w + all + 2 * c) \
  OF(double, small, 4 * w + s->rules.atoms) OF(double, atom_work, pair_room(s->atoms.size, 1)) \
  OF(double, choice_work, pair_room(s->choices.size, 1)) \
  OF(int32_t, pending, 6 * w + 2 * (all + q)) OF(int32_t, groups, 5 * w + 1) \
  /* of sets: multipliers, room, whether they move */ \
  OF(double, direction, w) OF(double, later, w) OF(double, heights_of, w) OF(double, aside, 2 * n) \
  OF(int8_t, moving, w) OF(int8_t, turned, rows) OF(double, rates_of_several, SEVERAL * n) \
  OF(double, layer_series, s->slope_outputs ? (tried * tried + sums * sums) * stride : 0) \
  OF(int8_t, idle, m) OF(int8_t, vanishes, most) /* sets without friction; nodes of a program that are zero */ \
  OF(double, spread, most) /* what nodes of a program may differ by in a step */ \
  OF(double, of_defect, rows) OF(int8_t, key, w + 8 * (s->rules.discrete + s->tables)) /* of_defect: errors of guards */ \
  OF(int32_t, cell, w) OF(double, levels, all + 1) /* of tables; target values of a projection */ \
  OF(double, jumped, s->resets ? HISTORY * n : 0) /* by the last events, states where those are resets */ \
  OF(double, root_at, rows) OF(double, hidden, rows) /* root of each guard in the step, or -1; its uncertainty by rounding */
  RUN_ARRAYS(DECLARED)
} Run;

/* Least size of a state, or of the time, for rounding. */
static double size_of_state(const Run *r, int i) { return i < r->s->dimension ? r->size : r->time_size; }
static double unit_of_state(const Run *r, int i) { return i < r->s->dimension ? 1 : r->time_size / r->size; }

/* Sums over the states of |gradient| times a vector: of layer, surfaces and gaps, stops and resets, factors; without sliding
 * only of surfaces, gaps, stops and resets. */
typedef struct { double *layer, *height, *stop, *factor; } Sums;

/* Functions of a law. ``i`` is the first function of an element, rows are those of its own guards. */
typedef struct {
  void (*lay_out)(const Run *r, Layout *l, int i); /* guards of a mode */
  void (*guard)(Run *r, const Layout *l, int row, const double *series, int count, double *g); /* their series */
  double (*rounding)(Run *r, const Expansion *e, int row, const Sums *of); /* in the guard of a row */
  int8_t (*side)(const Run *r, int i, double h); /* letter off its zero, where it has two by the present one */
  void (*serve)(Run *r, int row); /* at the zero of a guard */
} Law;

static void finish(Run *r, int status, int reason, int where) {
  if (r->status == RUNNING) { r->status = status; r->reason = reason; r->where = where; }
}

/* Allocate ``count`` objects of a size; without a base only count the bytes. */
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

/* Groups of four letters lead from the root of a tree to a leaf, whose child is the number of the mode plus one. */
static int32_t mode_number(Table *t, const int8_t *letter) {
  int32_t at = 0;
  for (int i = 0, four = 0; i < t->width; i += 4, four = 0) {
    memcpy(&four, letter + i, t->width - i < 4 ? t->width - i : 4);
    at = tree_child(&t->leaves, at, four);
  }
  int32_t *number = &t->leaves.node[at].child;
  if (*number) return *number - 1;
  if (t->count == t->room) {
    int8_t *more = realloc(t->letter, 2 * (size_t)t->room * (t->width + 1));
    if (!more) return 0;
    t->letter = more;
    t->room *= 2;
  }
  memcpy(t->letter + (int64_t)t->count * t->width, letter, t->width);
  *number = ++t->count;
  return t->count - 1;
}

Table *table_new(int32_t width) {
  Table *t = calloc(1, sizeof(Table));
  t->tree = (Tree){malloc(64 * sizeof(Node)), 1, 64};
  t->leaves = (Tree){malloc(64 * sizeof(Node)), 1, 64};
  t->tree.node[0] = t->leaves.node[0] = (Node){.parent = -1, .mode = -1};
  t->width = width;
  t->room = 64;
  t->letter = malloc((size_t)t->room * (width + 1));
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
void table_free(Table *t) { free(t->tree.node); free(t->leaves.node); free(t->letter); free(t); }
