/* Modes tried one by one, each with all its unknowns, where laws are not linear complementarity (hidden laws, products, sets
 * of codimension two and more). A mode can continue if the first nonzero coefficient of each of its guards that vanish here
 * is positive. */

static int bits(int a) { return (a & 1) + (a >> 1 & 1) + (a >> 2 & 1); }

/* Number of possible modes, or 0 where they are too many to try. */
static int choices_of(const Run *r, const int8_t *possible, int count) {
  int total = 1, most = r->s->combined ? DIODES_TRIED : TRIED;
  for (int i = 0; i < count && total <= most; i++) total *= bits(possible[i]);
  return total <= most ? total : 0;
}

/* Drop coefficients that are not finite. */
static void keep_finite(Run *r, Expansion *e) {
  for (int i = 0; i < r->n * r->stride; i++) if (!(fabs(e->states[i]) < INFINITY)) e->states[i] = 0;
  for (int i = 0; i < e->l.rows * r->stride; i++) if (!(fabs(e->guards[i]) < INFINITY)) e->guards[i] = 0;
}

/* Whether sliding is stable across its layers of equal width, closed contacts in balance, from r->slope. */
static int is_stable(Run *r, const Layout *l) {
  int n = l->slides, rows = 0, w = r->width;
  double *a = r->decision->block, *m = r->work;
  while (rows < n && is_bounded(r, l->sliding[rows])) rows++;
  for (int i = 0; i < n; i++) {
    double turn = i < rows ? -ns_sign(factor_of(r, l->sliding[i])) : 1;
    for (int j = 0; j < n; j++) m[i * n + j] = turn * r->slope[l->sliding[i] * w + l->sliding[j]];
  }
  for (int q = n - 1; q >= rows; q--)
    for (int i = 0; i < q && m[q * n + q] != 0; i++) {
      double f = m[i * n + q] / m[q * n + q];
      for (int j = 0; j < q && f != 0; j++) m[i * n + j] -= f * m[q * n + j];
    }
  for (int i = 0; i < rows; i++) for (int j = 0; j < rows; j++) a[i * rows + j] = m[i * n + j];
  return rows == 0 || is_positive_stable(a, rows, r->decision->work);
}

/* Whether all active elements but one have the letters of the previous mode: only then its guard decides it. */
static int others_stay(const Run *r, const int8_t *letter, int but) {
  for (int i = 0; i < r->active_count; i++) {
    int own = r->active[i], set = set_of(r, own);
    if (own != but && (set < 0 || set != set_of(r, but)) && letter[own] != r->letter[own]) return 0;
  }
  return 1;
}

/* Whether a guard is zero to a part of its terms. */
static int is_zero_to(Run *r, Expansion *e, int row, double part) {
  return fabs(e->guards[(int64_t)row * r->stride]) <= part * scales(r, e)[row];
}

/* Whether the motion can continue in a mode with given unknowns: its guards that vanish here become positive. */
static int continues(Run *r, const int8_t *letter, const Known *known, int known_count, Continuation *result) {
  Expansion *e = &r->trial;
  lay_out(r, letter, &e->l);
  if (e->l.slides) {
    error_scales(r, r->x, held_of(r, letter), result->unknowns);
    if (!is_stable(r, &e->l)) return 0;
  }
  expand(r, letter, r->x, result->unknowns, e);
  if (!e->finite) keep_finite(r, e);
  memcpy(result->letter, letter, r->width);
  result->strict = 1;
  memset(result->drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < e->l.rows; row++) {
    int kind = e->l.kind[row], index = e->l.index[row], zeros = 0;
    if (is_atom(kind)) continue;
    if (kind == NEAR_GUARD && letter[index] == 0) continue; /* ends steps only */
    if (!is_active(r, index)) continue;
    for (int i = 0; i < known_count; i++)
      if (known[i].kind == kind && known[i].index == index && known[i].side == e->l.side[row] && others_stay(r, letter, index)
          && (!r->s->combined || is_zero_to(r, e, row, KNOWN_TO * r->o.rtol))) /* unknowns that keep equations may jump */
        zeros = known[i].zeros;
    if (!zeros && is_half_line(r, index) && is_zero_to(r, e, row, r->equations.off)) zeros = 1;
    int least = kind == SURFACE_GUARD || kind == NEAR_GUARD || kind == IMPACT_GUARD ? degree_of(r, index) : 0;
    if (zeros < least) zeros = least;
    double value;
    int k = leading(r, e, row, zeros, &value);
    if (value < 0) return 0;
    if (value == 0) result->strict = 0;
    result->drop[row] = value != 0 ? (k < r->order ? k : r->order) : r->order + 1;
  }
  return 1;
}

static void choose_found(Run *r) { Continuation found = r->found; r->found = r->chosen; r->chosen = found; }

static int rests(const Run *r, const int8_t *letter) {
  for (int i = 0; i < r->width; i++) if (letter[i] == 0) return 1;
  return 0;
}

/* Admissible modes so far; the rank of the chosen one: 2 if none of its guards stays zero, else 1. */
typedef struct { int strict, found, rank; } Tally;

/* Whether the admissible mode of r->trial has the motion of the first one, up to undetermined loads. Store it if it is the
 * first. */
static int is_found(Run *r, const Tally *t) {
  Motion *first = r->decision->motion, *own = first + 1;
  first->terms = own->terms = COMPARED;
  for (int i = 0; i < r->n; i++)
    memcpy((t->strict ? own : first)->series + i * COMPARED, r->trial.states + (int64_t)i * r->stride + 1, sizeof(double) * COMPARED);
  return t->strict && is_same_motion(r, first, own);
}

/* Count r->found, of r->trial; the first of the highest rank is r->chosen. */
static void count_found(Run *r, Tally *t) {
  int strict = r->found.strict, rank = strict ? 2 : rests(r, r->found.letter);
  if (r->s->combined && strict && is_found(r, t)) return;
  if (strict && r->several_count < SEVERAL) r->several[r->several_count++] = r->trial.l.mode;
  if (!t->found || rank > t->rank) { t->rank = rank; choose_found(r); }
  t->strict += strict;
  t->found++;
}

/* Whether r->chosen continues; 0 where none does, or more than one and the run ends. */
static int is_chosen(Run *r, const Tally *t) {
  if (t->strict > 1) finish(r, NON_UNIQUE, AMBIGUOUS, 0);
  return t->strict < 2 && t->found && (t->rank || t->found == 1);
}

/* Letters of the active elements by the number of a choice of possible letters. */
static void spell_choice(const Run *r, const int8_t *letter, const int8_t *possible, int number, int8_t *trial) {
  memcpy(trial, letter, r->width);
  for (int i = r->active_count - 1; i >= 0; i--) {
    int which = number % bits(possible[i]);
    number /= bits(possible[i]);
    for (int bit = 0; bit < 3; bit++)
      if (possible[i] >> bit & 1 && which-- == 0) trial[r->active[i]] = bit == 0 ? 1 : bit == 1 ? -1 : 0;
  }
  for (int i = 0; i < r->active_count; i++) { /* a set has one letter, that of its first function */
    int s = set_of(r, r->active[i]);
    if (s >= 0) trial[r->active[i]] = trial[s] ? LEAVING : 0;
  }
}

/* Unknowns that enter nonlinearly: hidden laws and products of multipliers. In the layer of a surface lambda moves
 * with the rate of h, x at rest, until an attracting root of that rate or its bound (Jeffrey 2018). */

/* Most solutions of a mode; unknowns that can enter in products. */
enum { SOLUTIONS = 16, FACTORS = 4, CORNERS = 1 << FACTORS };

/* Solutions of one mode, each the unknowns of all elements. */
typedef struct { double *each; int32_t count, width; } Solutions;

static int is_mixed(const Run *r, const int32_t *own, int count) {
  if (r->s->affine) return 0;
  for (int i = 0; i < count; i++)
    for (int j = 0; j < count; j++) if (r->s->mixed[own[i] * r->width + own[j]]) return 1;
  return 0;
}

/* Series of the rate of an element along its multiplier, x and the others at rest. */
static void rate_along(Run *r, const Layout *l, const double *unknowns, int own, double *g) {
  const Series *t = &r->s->series;
  double *x = r->vector, *lam = x + r->n;
  aim(r, l->letter, r->x, unknowns);
  held_of(r, l->letter);
  for (int k = 0; k <= r->order; k++) {
    memset(x, 0, sizeof(double) * (r->n + r->width));
    if (k == 0) memcpy(x, r->x, sizeof(double) * r->n);
    if (k == 0) memcpy(lam, unknowns, sizeof(double) * r->width);
    if (k == 1) lam[own] = 1;
    set_inputs(r, x, k ? r->none : r->held, lam);
    series_at(t, k ? &t->later : &t->moving, k, r->stride, r->input, r->series);
    g[k] = row_of(r, r->n + own)[k];
  }
}

/* Length up to which a series is exact to rounding, at most h. */
static double exact_length(const double *g, int order, double h) {
  for (int again = 0; again < DEPTH; again++) {
    double power = pow(h, order - 1), size = fabs(g[0]) + rest_of(g, order - 2, h);
    double last = power * larger(fabs(g[order]) * h, fabs(g[order - 1]));
    if (last <= VANISHES * size || !(size > 0 && last < INFINITY)) break;
    h *= 0.9 * pow(VANISHES * size / last, 1.0 / (order - 1));
  }
  return h;
}

/* Coefficients of a rate that vanish at a root, at least ``zeros``: two at a fold. */
static int zeros_of(const double *g, int order, double h, int zeros) {
  double size = fabs(g[0]) + rest_of(g, order, h), power = pow(h, zeros);
  while (zeros < order && !(fabs(g[zeros]) * power > LAYER_ROUNDING * size)) { zeros++; power *= h; }
  return zeros;
}

/* Roots of the rate of an element between two values of its multiplier; ``zeros`` coefficients vanish at the first. -1 where
 * the rate is not finite. */
static int roots_along(Run *r, const Layout *l, double *unknowns, int own, double from, double to, int zeros,
                       double *root) {
  int order = r->order, count = 0;
  double way = to > from ? 1 : -1, at = from, most = INFINITY, g[P + 1], next[P + 1];
  unknowns[own] = at;
  rate_along(r, l, unknowns, own, g);
  for (int piece = 0; piece < LAYER_PIECES && (to - at) * way > 0 && count < SOLUTIONS; piece++) {
    if (!finite_all(g, order + 1)) return -1;
    if (way < 0) for (int k = 1; k <= order; k += 2) g[k] = -g[k];
    double left = (to - at) * way, h = exact_length(g, order, smaller(smaller(left, most), LAYER_LONGEST));
    int drop = zeros_of(g, order, h, zeros);
    double turn = ns_sign(g[drop]), end = value_at(g, order, h), size = fabs(g[0]) + rest_of(g, order, h);
    for (int k = 0; k <= order; k++) g[k] *= turn;
    double s = first_root(g + drop, order - drop, h), ahead = s > 0 ? s : h;
    double there = ahead == left ? to : at + way * ahead;
    unknowns[own] = there;
    rate_along(r, l, unknowns, own, next);
    if (fabs(next[0] - (s > 0 ? 0 : end)) > sqrt(EPSILON) * size) { /* a pole or a pulse that the series misses */
      most = 0.5 * h;
      unknowns[own] = at;
      rate_along(r, l, unknowns, own, g);
      continue;
    }
    at = there;
    most = INFINITY;
    zeros = s > 0;
    if (s > 0) root[count++] = at;
    memcpy(g, next, sizeof g);
  }
  return count;
}

/* Add a solution after Newton's method if it is new and unknowns of surfaces are within their bounds. */
static void keep_solution(Run *r, const Layout *l, double *unknowns, int steps, Solutions *found) {
  int w = r->width;
  if (found->count == SOLUTIONS || !improve(r, l, r->x, unknowns, steps)) return;
  error_scales(r, r->x, held_of(r, l->letter), unknowns);
  for (int i = 0; i < l->slides; i++) {
    int own = l->sliding[i];
    double slope = 0;
    for (int j = 0; j < l->slides; j++) slope += fabs(r->slope[own * w + l->sliding[j]]);
    if (!(fabs(layer_of(r, own)) <= LAYER_RESIDUAL * (1 + slope))) return;
    if (is_bounded(r, own) && !(fabs(unknowns[own]) <= fabs(factor_of(r, own)) * (1 + LAYER_BEYOND))) return;
  }
  for (int k = 0; k < found->count; k++) {
    double apart = 0;
    for (int i = 0; i < w; i++) apart = larger(fabs(unknowns[i] - found->each[k * w + i]), apart);
    if (apart <= LAYER_APART) return;
  }
  memcpy(found->each + found->count++ * w, unknowns, sizeof(double) * w);
}

/* The box of a product's variables; its functions are linear in each variable. */
typedef struct { const Layout *l; const double *low, *width; double *unknowns; int k; } Cube;

/* Solutions in a box by bisection: a function that is linear in each variable is between its values at the corners. */
static void search_cube(Run *r, const Cube *c, const double *corner, const double *at, double size, int depth,
                        Solutions *found) {
  int k = c->k, axis = depth % k, step = 1 << axis;
  double half[CORNERS * FACTORS], next[FACTORS];
  for (int f = 0; f < k; f++) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 1 << k; i++) { low = smaller(corner[i * k + f], low); high = larger(corner[i * k + f], high); }
    if (!(low <= 0 && high >= 0)) return;
  }
  if (depth == LAYER_HALVINGS * k) {
    for (int i = 0; i <= 1 << k; i++) { /* two solutions may be close to a fold: from the corners and the centre */
      for (int j = 0; j < k; j++)
        c->unknowns[c->l->sliding[j]] = c->low[j] + c->width[j] * (at[j] + size * (i == 1 << k ? 0.5 : i >> j & 1));
      keep_solution(r, c->l, c->unknowns, LAYER_NEWTON, found);
    }
    return;
  }
  memcpy(next, at, sizeof next);
  for (int side = 0; side < 2; side++) {
    for (int i = 0; i < 1 << k; i++)
      for (int f = 0; f < k; f++)
        half[i * k + f] = (i >> axis & 1) == side ? corner[i * k + f]
                                                  : 0.5 * (corner[i * k + f] + corner[(i ^ step) * k + f]);
    next[axis] = at[axis] + side * 0.5 * size;
    search_cube(r, c, half, next, axis == k - 1 ? 0.5 * size : size, depth + 1, found);
  }
}

/* Solutions of a mode whose multipliers enter in products, each linearly. */
static void solve_products(Run *r, const Layout *l, double *unknowns, Solutions *found) {
  int k = l->slides;
  double corner[CORNERS * FACTORS], low[FACTORS], width[FACTORS], start[FACTORS] = {0};
  error_scales(r, r->x, held_of(r, l->letter), unknowns);
  for (int i = 0; i < k; i++) {
    low[i] = -fabs(factor_of(r, l->sliding[i])) * (1 + LAYER_BEYOND);
    width[i] = -2 * low[i];
  }
  for (int c = 0; c < 1 << k; c++) {
    for (int i = 0; i < k; i++) unknowns[l->sliding[i]] = low[i] + (c >> i & 1) * width[i];
    error_scales(r, r->x, held_of(r, l->letter), unknowns);
    for (int f = 0; f < k; f++) corner[c * k + f] = layer_of(r, l->sliding[f]);
  }
  if (!finite_all(corner, k << k)) return;
  search_cube(r, &(Cube){l, low, width, unknowns, k}, corner, start, 1, 0, found);
}

/* Solutions of a mode with other laws or with reactions: Newton's method from a grid. */
static void solve_from_grid(Run *r, const Layout *l, double *unknowns, Solutions *found) {
  int surfaces = 0, points = 1;
  for (int i = 0; i < l->slides; i++) surfaces += is_bounded(r, l->sliding[i]);
  for (int i = 0; i < surfaces && points < LAYER_STARTS; i++) points *= LAYER_GRID;
  for (int number = 0; number < points; number++) {
    memset(unknowns, 0, sizeof(double) * r->width);
    for (int i = 0, rest = number; i < l->slides; i++)
      if (is_bounded(r, l->sliding[i])) {
        unknowns[l->sliding[i]] = (2.0 * (rest % LAYER_GRID) + 1) / LAYER_GRID - 1;
        rest /= LAYER_GRID;
      }
    keep_solution(r, l, unknowns, LAYER_NEWTON, found);
  }
}

/* All unknowns of a mode in which sets are left; as mode_solutions. */
static void solutions_of_leaving(Run *r, const Layout *l, Solutions *found) {
  Decision *d = r->decision;
  int kept = r->active_count, count = 0, w = r->width;
  memcpy(r->involved, r->active, sizeof(int32_t) * kept);
  for (int i = 0; i < w; i++)
    if (l->letter[i] == LEAVING || (l->letter[i] == 0 && !is_idle(r, l->letter, i) && !has_law(r, i, JOINT_LAW)))
      r->active[count++] = i;
  r->active_count = count;
  if (begin_law(r, l->letter, 0, 0)) {
    for (int i = 0; i < count; i++) { d->is_touched[i] = 1; d->state[i] = l->letter[d->own[i]] ? ABOVE : INSIDE; }
    d->is_imposed = 1;
    explore(r, d, 0, 0);
  }
  memcpy(r->active, r->involved, sizeof(int32_t) * kept);
  r->active_count = kept;
  for (int q = 0; q < d->motions && r->status == RUNNING; q++) {
    double *unknowns = found->each + found->count * w;
    keep_carried(r, l->letter, unknowns);
    for (int i = 0; i < count; i++) unknowns[d->own[i]] = d->motion[q].nu[i];
    found->count += !l->slides || improve(r, l, r->x, unknowns, 2);
  }
}

/* All unknowns of a mode that keep its sliding functions at zero. */
static void mode_solutions(Run *r, const Layout *l, Solutions *found) {
  int w = r->width, bent = 0, contacts = 0;
  double *unknowns = r->tried, root[SOLUTIONS];
  found->each = r->solutions;
  found->count = 0;
  keep_carried(r, l->letter, unknowns);
  for (int i = 0; r->s->sets && i < r->m; i++)
    if (l->letter[i] == LEAVING) { solutions_of_leaving(r, l, found); return; }
  if (!is_mixed(r, l->sliding, l->slides)) {
    if (!satisfies(r, l->letter) || (l->slides && !improve(r, l, r->x, unknowns, 2))) return;
    memcpy(found->each, unknowns, sizeof(double) * w);
    found->count = 1;
    return;
  }
  for (int i = 0; i < l->slides; i++) {
    bent |= r->s->mixed[l->sliding[i] * (w + 1)];
    contacts |= !is_bounded(r, l->sliding[i]);
  }
  if (l->slides == 1) {
    int own = l->sliding[0], count = roots_along(r, l, unknowns, own, -1 - LAYER_BEYOND, 1 + LAYER_BEYOND, 0, root);
    for (int k = 0; k < count; k++) { unknowns[own] = root[k]; keep_solution(r, l, unknowns, 2, found); }
  } else if (!bent && !contacts && l->slides <= FACTORS) solve_products(r, l, unknowns, found);
  else solve_from_grid(r, l, unknowns, found);
}

/* Keep solutions of a mode with a hidden law that attract in the layer, if there are several. */
static void keep_stable(Run *r, const Layout *l, Solutions *found) {
  int kept = 0, w = r->width, bent = 0;
  for (int i = 0; i < l->slides; i++) bent |= r->s->mixed[l->sliding[i] * (w + 1)];
  if (!bent) return;
  for (int k = 0; k < found->count; k++) {
    const double *own = found->each + k * w;
    error_scales(r, r->x, held_of(r, l->letter), own);
    if (is_stable(r, l)) memmove(found->each + kept++ * w, own, sizeof(double) * w);
  }
  found->count = kept;
}

/* Unknowns of a mode to r->unknowns; the number of solutions, which has to be one. */
static int find_unknowns(Run *r, const Layout *l) {
  Solutions all = {0};
  mode_solutions(r, l, &all);
  if (all.count > 1) keep_stable(r, l, &all);
  if (all.count == 1) memcpy(r->unknowns, all.each, sizeof(double) * r->width);
  return all.count;
}

/* The previous multiplier of the one active surface, and its direction of motion; 0 where that is unknown. */
static int way_in_layer(Run *r, const Layout *l, double *from) {
  int own = r->active[0], kind = r->guard.kind;
  double g[P + 1];
  if (r->active_count != 1 || (kind == BRANCH_GUARD ? r->folded : r->guard.index) != own) return 0;
  *from = r->guard.side;
  if (kind == SURFACE_GUARD) return -r->guard.side;
  if (kind == EXIT_GUARD) return r->guard.side;
  if (kind != BRANCH_GUARD) return 0;
  memcpy(r->tried, r->unknowns, sizeof(double) * r->width);
  rate_along(r, l, r->tried, own, g);
  *from = r->unknowns[own];
  return g[2] > 0 ? 1 : -1;
}

/* Keep unknowns of a mode besides that of the decided element. */
static void keep_others(const Run *r, const int8_t *letter, int own, double *unknowns) {
  keep_carried(r, letter, unknowns);
  for (int i = 0; i < r->width; i++) if (i != own && letter[i] == 0 && r->letter[i] == 0) unknowns[i] = r->unknowns[i];
}

/* The element whose guard or fold ended the mode, if all other active ones keep their letters and no unknown couples it to
 * them; else -1. */
static int moves_alone(Run *r, const int8_t *letter) {
  int own = r->guard.kind == BRANCH_GUARD ? r->folded : r->guard.index, w = r->width, is_active = 0;
  if (r->guard.kind != SURFACE_GUARD && r->guard.kind != EXIT_GUARD && r->guard.kind != BRANCH_GUARD) return -1;
  if (r->guard.kind != BRANCH_GUARD && !r->guard.side) return -1;
  error_scales(r, r->x, held_of(r, r->letter), r->unknowns);
  for (int k = 0; k < r->active_count; k++) {
    int i = r->active[k];
    is_active |= i == own;
    if (i == own) continue;
    if (r->letter[i] != 0 || letter[i] != 0 || r->s->mixed[own * w + i] || r->s->mixed[i * w + own]) return -1;
    if (r->slope[own * w + i] != 0 || r->slope[i * w + own] != 0) return -1;
  }
  return is_active && r->s->mixed[own * (w + 1)] ? own : -1;
}

/* The mode that the layer dynamics of one surface reach: the first attracting root, or the side at the end. */
static int follow_in_layer(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int own = r->active[0], count;
  double from, root[SOLUTIONS];
  Layout *l = &r->trial.l;
  int8_t *trial = r->tried_letter;
  memcpy(trial, letter, r->width);
  trial[own] = 0;
  lay_out(r, trial, l);
  int way = way_in_layer(r, l, &from);
  if (!way) return 0;
  keep_others(r, trial, own, r->tried);
  count = roots_along(r, l, r->tried, own, from, way, r->guard.kind == BRANCH_GUARD ? 2 : 0, root);
  for (int k = 0; k <= count && r->status == RUNNING; k++) {
    trial[own] = k < count ? 0 : (int8_t)way;
    keep_others(r, trial, own, r->found.unknowns);
    if (k < count) r->found.unknowns[own] = root[k];
    if (!continues(r, trial, known, known_count, &r->found) || !r->found.strict) continue;
    choose_found(r);
    return 1;
  }
  return 0;
}

/* Whether a solution is the one that just ended in a fold. */
static int is_folded(const Run *r, const int8_t *letter, const double *unknowns) {
  double apart = 0;
  if (r->guard.kind != BRANCH_GUARD || memcmp(letter, r->letter, r->width)) return 0;
  for (int i = 0; i < r->width; i++) apart = larger(fabs(unknowns[i] - r->unknowns[i]), apart);
  return apart <= FOLD_APART;
}

/* Choose the motion that continues as r->chosen, of all modes and all their solutions. */
static int try_modes(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int k = r->active_count;
  int8_t *trial = r->tried_letter, *possible = trial + r->width;
  Solutions all = {0};
  Tally tally = {0};
  for (int i = 0; i < k; i++) {
    int own = r->active[i], s = set_of(r, own);
    possible[i] = s >= 0 && own != s ? 4 : s == own || is_half_line(r, own) ? 5 : 7;
  }
  int total = choices_of(r, possible, k);
  if (!total) { finish(r, NON_UNIQUE, POSSIBLY_SEVERAL, 0); return 0; }
  r->several_count = 0;
  for (int number = 0; number < total && r->status == RUNNING; number++) {
    spell_choice(r, letter, possible, number, trial);
    lay_out(r, trial, &r->trial.l);
    mode_solutions(r, &r->trial.l, &all);
    for (int q = 0; q < all.count && r->status == RUNNING; q++) {
      memcpy(r->found.unknowns, all.each + q * r->width, sizeof(double) * r->width);
      if (is_folded(r, trial, r->found.unknowns)) continue;
      if (continues(r, trial, known, known_count, &r->found)) count_found(r, &tally);
    }
  }
  return r->status == RUNNING && (is_chosen(r, &tally) || no_motion(r, letter));
}

/* Choose the motion that continues where unknowns of the active elements enter nonlinearly. */
static int decide_in_layer(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int alone = r->active_count == 1, own = alone ? r->active[0] : moves_alone(r, letter), count = r->active_count;
  if (own >= r->m || r->s->joints) own = -1;
  if (own >= 0 && is_two_fold(r, letter, own, 0)) { finish(r, NON_UNIQUE, TWO_FOLD, own); return 0; }
  if (own >= 0) {
    int32_t first = r->active[0];
    r->active[0] = own;
    r->active_count = 1;
    int found = follow_in_layer(r, letter, known, known_count);
    r->active[0] = first;
    r->active_count = count;
    if (found) return 1;
  }
  return r->status == RUNNING && try_modes(r, letter, known, known_count);
}

/* Folds of sliding: where the slope of the layer vanishes the multipliers vary as a root of the time. With one of them as the
 * independent variable states, time and the others are regular there. */

/* Whether sliding may end in a fold within some steps of length h. */
static int is_fold_ahead(const Run *r, const Expansion *e, double h) {
  if (!is_mixed(r, e->l.sliding, e->l.slides)) return 0;
  for (int row = 0; row < e->l.rows; row++) {
    const double *g = e->guards + (int64_t)row * r->stride;
    if (e->l.kind[row] == BRANCH_GUARD && g[0] < -FOLD_AHEAD * h * g[1]) return 1;
  }
  return 0;
}

/* Whether a step ends at a spurious root of a series near a fold; the fold is then approached more closely. */
static int is_before_fold(const Run *r, const Expansion *e, int row, double dt) {
  if (e->l.kind[row] != BRANCH_GUARD || !is_mixed(r, e->l.sliding, e->l.slides)) return 0;
  return dt > FOLD_NEAR * time_scale(r);
}

/* Series in the multiplier of sliding[lead], which moves in a direction, of states, of the others and of the rate
 * of the time; 0 where there is none. */
static int series_in_multiplier(Run *r, Expansion *f, int lead, double way, double *rate) {
  int slides = f->l.slides, w = r->width, n = r->n, order = r->order, stride = r->stride;
  double *drift = r->lam, *a = r->work, *b = a + slides * slides;
  held_of(r, f->l.letter);
  open_order(r, f, 0);
  for (int i = 0; i < n; i++) f->states[(int64_t)i * stride + 1] = row_of(r, i)[0];
  open_order(r, f, 1);
  for (int i = 0; i < slides; i++) drift[i] = row_of(r, n + f->l.sliding[i])[1];
  for (int k = 1; k <= order; k++) {
    for (int i = 0; i < n; i++) {
      double *x = f->states + (int64_t)i * stride;
      x[k] = 0;
      for (int j = 0; j < k - 1; j++) x[k] += rate[j] * row_of(r, i)[k - 1 - j] / k;
    }
    f->series[(int64_t)f->l.sliding[lead] * stride + k] = k == 1 ? way : 0;
    open_order(r, f, k);
    for (int i = 0; i < slides; i++) {
      b[i] = -row_of(r, n + f->l.sliding[i])[k];
      for (int j = 0; j < slides; j++)
        a[i * slides + j] = j == lead ? drift[i] / k : r->slope[f->l.sliding[i] * w + f->l.sliding[j]];
    }
    if (!solve(a, b, slides)) return 0;
    rate[k - 1] = b[lead];
    for (int i = 0; i < slides; i++) if (i != lead) f->series[(int64_t)f->l.sliding[i] * stride + k] = b[i];
    for (int i = 0; i < n; i++) f->states[(int64_t)i * stride + k] += row_of(r, i)[0] * b[lead] / k;
    open_order(r, f, k);
  }
  rate[order] = 0;
  return 1;
}

/* Integral of a series. */
static double integral(const double *c, int order, double s) {
  double sum = 0;
  for (int k = order; k >= 0; k--) sum = (sum + c[k] / (k + 1)) * s;
  return sum;
}

/* States of a step as cubic polynomials of the time, from those in a multiplier; 0 where that is not accurate. */
static int in_time(Run *r, Expansion *f, const double *rate, double s, double dt, const double *field) {
  int order = r->order, stride = r->stride;
  for (int i = 0; i < r->n; i++) {
    double *x = f->states + (int64_t)i * stride, end = value_at(x, order, s), slope, cubic[4];
    double start = rate[0] != 0 ? x[1] / rate[0] : field[i], mean = (end - x[0]) / dt;
    cubic[0] = x[0];
    cubic[1] = start;
    cubic[2] = (3 * mean - 2 * start - field[i]) / dt;
    cubic[3] = (start + field[i] - 2 * mean) / (dt * dt);
    for (int q = 1; q < 4; q++) {
      double part = 0.25 * q * s, at = integral(rate, order, part);
      double off = fabs(horner(cubic, 3, at, &slope) - value_at(x, order, part));
      if (off > f->allowed[i] + VANISHES * (size_of_state(r, i) + fabs(x[0])) + (i < r->s->dimension ? 0 : TIE * fabs(x[0]))) return 0;
    }
    memset(x, 0, sizeof(double) * stride);
    memcpy(x, cubic, sizeof cubic);
  }
  return 1;
}

/* Go to the fold of sliding, if it is the next event; its row, or -1. */
static int reach_fold(Run *r, const Expansion *e, double left) {
  int slides = e->l.slides, lead = 0, order = r->order, stride = r->stride, row, last = -1;
  double rate[P + 1], h = INFINITY, ds, *end = r->lam, *field = r->at_work;
  Expansion *f = &r->trial;
  for (int i = 1; i < slides; i++)
    if (fabs(e->series[(int64_t)e->l.sliding[i] * stride + 1]) > fabs(e->series[(int64_t)e->l.sliding[lead] * stride + 1])) lead = i;
  lay_out(r, e->l.letter, &f->l);
  memset(f->series, 0, sizeof(double) * r->width * stride);
  memset(f->states, 0, sizeof(double) * r->n * stride);
  for (int i = 0; i < r->n; i++) f->states[(int64_t)i * stride] = r->x[i];
  for (int i = 0; i < slides; i++) f->series[(int64_t)e->l.sliding[i] * stride] = r->unknowns[e->l.sliding[i]];
  memcpy(f->inverse, e->inverse, sizeof(double) * e->entries);
  memcpy(f->column, e->column, sizeof(int32_t) * e->entries);
  memcpy(f->from, e->from, sizeof(int32_t) * slides);
  memcpy(f->to, e->to, sizeof(int32_t) * slides);
  memcpy(f->allowed, e->allowed, sizeof(double) * r->n);
  f->scaled = f->steepened = 0;
  weigh_point(r, f, r->x, r->unknowns);
  if (!series_in_multiplier(r, f, lead, ns_sign(e->series[(int64_t)e->l.sliding[lead] * stride + 1]), rate)) return -1;
  h = exact_length(rate, order - 1, 2 * (1 + fabs(r->unknowns[e->l.sliding[lead]])));
  for (int i = 0; i < r->n; i++) h = exact_length(f->states + (int64_t)i * stride, order, h);
  for (int i = 0; i < slides; i++) h = exact_length(f->series + (int64_t)e->l.sliding[i] * stride, order, h);
  double s = rate[0] > 0 ? first_root(rate, order - 1, h) : -1, dt = s > 0 ? integral(rate, order - 1, s) : -1;
  if (!(dt > 0 && dt <= smaller(left, r->o.max_step))) return -1;
  r->expansion = f;
  guard_rows(r, &f->l, f->series, order + 1, f->guards);
  row = first_hit(r, f, s, &ds);
  memset(r->instant.passing, 0, r->s->rules.atoms);
  for (int k = 0; k < f->l.rows; k++) {
    int is_own = last < 0 || k == row || (f->l.index[k] == e->l.sliding[lead] && last != row);
    if (f->l.kind[k] == BRANCH_GUARD && is_own) last = k;
  }
  if (last < 0 || (row >= 0 && row != last && ds < s) || r->hold < s) return -1;
  note_sides(r, f, s);
  for (int i = 0; i < r->width; i++) end[i] = value_at(f->series + (int64_t)i * stride, order, s);
  for (int i = 0; i < r->n; i++) r->before[i] = value_at(f->states + (int64_t)i * stride, order, s);
  field_of(r, r->before, held_of(r, f->l.letter), end, field);
  if (!in_time(r, f, rate, s, dt, field)) return -1;
  memcpy(r->tried, end, sizeof(double) * r->width);
  memset(f->series, 0, sizeof(double) * r->width * stride);
  for (int i = 0; i < slides; i++) f->series[(int64_t)e->l.sliding[i] * stride] = end[e->l.sliding[i]];
  if (!advance(r, f, dt)) return -1;
  r->folded = e->l.sliding[lead];
  memcpy(r->unknowns, r->tried, sizeof(double) * r->width);
  return last;
}
