/* Modes: nonsmooth/model/laws/coupled.py --------------------------------------------------------------------- */

static const Element *element(const Run *r, int i) { return r->s->element + i; }
static int degree_of(const Run *r, int i) { return element(r, i)->degree; }
static int is_scaled(const Run *r, int i) { return element(r, i)->flags & SCALED; }
static int has_law(const Run *r, int i, int law) { return element(r, i)->law == law; }
static int size_of(const Run *r, int i) { return element(r, i)->k; }

/* Whether the multiplier of an element is not negative, and zero where it is open: contacts, complementarity. */
static int is_half_line(const Run *r, int i) {
  return element(r, i)->law == CONTACT_LAW || element(r, i)->law == COMPLEMENTARITY_LAW;
}

/* Whether an unknown is in a set of finite size: not reactions. */
static int is_bounded(const Run *r, int i) { return !is_half_line(r, i) && !has_law(r, i, JOINT_LAW); }

/* The set of a function, as its first one, or -1; all sets. */
static int set_of(const Run *r, int i) { return element(r, i)->law == SET_LAW ? element(r, i)->first : -1; }
#define EACH_SET(run, set) \
  for (int set = 0; set < ((run)->s->sets ? (run)->m : 0); set++) if (set_of(run, set) == set)
#define EACH_LEAVING(run, e, set) EACH_SET(run, set) if ((e)->l.letter[set] == LEAVING)

/* Whether friction has no load: all contacts that carry it are open, and with ``scale`` (after surface_values) none of them is
 * at rest on zero. */
static int is_unloaded(const Run *r, const int8_t *letter, int i, const double *scale) {
  int carried = 0;
  for (int j = 0; j < r->c; j++) {
    int gap = r->m + j, rate = gap + r->c;
    if (!r->s->carries[i * r->c + j]) continue;
    if (!letter[gap]) return 0;
    if (scale && fabs(r->rates[gap]) <= ON_SURFACE * scale[gap] && fabs(r->rates[rate]) <= ON_SURFACE * scale[rate]) return 0;
    carried = 1;
  }
  return carried;
}

/* Whether a multiplier does not act: on its surface, or where all contacts that carry it are open. */
static int is_idle(const Run *r, const int8_t *letter, int i) {
  return i < r->m && (element(r, i)->flags & CONTINUOUS || is_unloaded(r, letter, i, 0));
}

/* Whether an element is among the active ones. */
static int is_active(const Run *r, int i) {
  for (int j = 0; j < r->active_count; j++) if (r->active[j] == i) return 1;
  return 0;
}

/* Merge the groups of two elements into the one of lower number, unless an element has none. */
static void join_groups(int32_t *group, int count, int i, int j) {
  int a = group[i], b = group[j];
  for (int q = 0; q < count && a >= 0 && b >= 0 && a != b; q++) if (group[q] == (a > b ? a : b)) group[q] = a < b ? a : b;
}

static int add_row(Layout *l, int kind, int index, int side) {
  int k = l->rows++;
  l->kind[k] = kind; l->index[k] = index; l->side[k] = side;
  return k;
}

static int is_atom(int kind) { return kind == STOP_GUARD || kind == RESET_GUARD || kind == ATOM_GUARD; }

/* Whether a guard is not affine in the states: the polynomial of an affine one needs no check. */
static int is_bent(const Run *r, int kind, int index) {
  const int32_t *bent = r->s->bent_guards;
  if (kind == SURFACE_GUARD || kind == IMPACT_GUARD) return bent[index];
  if (kind == STOP_GUARD) return bent[r->width + index];
  if (kind == RESET_GUARD) return bent[r->width + r->s->stops + index];
  if (kind == ATOM_GUARD) return bent[r->width + r->s->stops + r->s->resets + index];
  return kind != BRANCH_GUARD;
}

/* Number of a mode in results, with values of the discrete states (or none) and cells of tables. */
static int32_t numbered(const Run *r, const int8_t *letter, const double *values) {
  int count = r->s->rules.discrete, tables = r->s->tables;
  if (!count && !tables) return mode_number(r->table, letter);
  memcpy(r->key, letter, r->width);
  int8_t *to = r->key + r->width;
  for (int d = 0; d < count; d++, to += sizeof(double)) {
    double value = values ? values[d] + 0.0 : 0; /* not -0 */
    memcpy(to, &value, sizeof(double));
  }
  for (int i = 0; tables && i < r->m; i++) {
    double value = r->cell[i];
    if (has_law(r, i, TABLE_LAW)) { memcpy(to, &value, sizeof(double)); to += sizeof(double); }
  }
  return mode_number(r->table, r->key);
}

static int32_t shown_number(const Run *r, const int8_t *letter) {
  return numbered(r, letter, r->x + r->s->dimension - r->s->rules.discrete);
}

static void lay_out(const Run *r, const int8_t *letter, Layout *l) {
  const System *s = r->s;
  if (l->mode >= 0 && !memcmp(l->letter, letter, r->width)) return;
  memmove(l->letter, letter, r->width);
  l->rows = l->slides = l->branches = 0;
  l->is_free = 1;
  l->mode = numbered(r, letter, 0);
  for (int i = 0; i < r->width; i++) {
    l->is_free &= letter[i] != 0 && letter[i] != LEAVING;
    if (letter[i] == 0 && !is_idle(r, letter, i)) l->sliding[l->slides++] = i;
    if (i == element(r, i)->first && law_of(r, i)->lay_out) law_of(r, i)->lay_out(r, l, i);
  }
  l->atoms = l->rows;
  for (int a = 0; a < s->rules.atoms; a++) {
    int kind = a < s->stops ? STOP_GUARD : a < s->stops + s->resets ? RESET_GUARD : ATOM_GUARD;
    int first = kind == STOP_GUARD ? 0 : kind == RESET_GUARD ? s->stops : s->stops + s->resets;
    add_row(l, kind, a - first, s->rules.way[a]);
  }
  add_branches(r, l);
  l->bent_count = 0;
  for (int k = 0; k < l->rows; k++) if (is_bent(r, l->kind[k], l->index[k])) l->bent[l->bent_count++] = k;
}

/* Enter the mode of the present letters. */
static void enter_mode(Run *r) {
  lay_out(r, r->letter, &r->now);
  r->mode = r->now.mode;
}

/* Letters as known multipliers: +1 and -1, 0 for sliding functions and contacts. */
static const double *held_of(Run *r, const int8_t *letter) {
  for (int i = 0; i < r->width; i++) r->held[i] = is_half_line(r, i) ? 0 : letter[i] > 1 ? r->direction[i] : letter[i];
  return r->held;
}

/* Whether a switching function belongs to a set that the mode is off. */
static int is_moving(const Run *r, int i) { return r->s->sets && r->moving[i]; } /* a contact never is */

/* Number of moving inputs: states, unknowns, those of scaled elements again. */
static int moving_size(const Run *r) {
  int size = r->n + r->width;
  for (int i = 0; i < r->m; i++) size += is_scaled(r, i) != 0;
  return size;
}

/* The unknown of a moving input after the states; -1 where the mode does not have it. */
static int unknown_at(const Run *r, int column) {
  int i = column - r->n, nu = i - r->width;
  if (nu < 0) return i >= r->m || is_moving(r, i) || !is_scaled(r, i) ? i : -1;
  for (i = 0; i < r->m; i++) if (is_scaled(r, i) && nu-- == 0) return is_moving(r, i) ? -1 : i;
  return -1;
}

/* The moving inputs: states, lambda and reactions, then nu. */
static void set_inputs(Run *r, const double *x, const double *held, const double *unknowns) {
  double *in = r->input;
  memcpy(in, x, sizeof(double) * r->n);
  in += r->n;
  for (int i = 0; i < r->width; i++)
    in[i] = held[i] + (is_scaled(r, i) || is_moving(r, i) ? 0 : unknowns[i]);
  in += r->width;
  for (int i = 0; i < r->m; i++) if (is_scaled(r, i)) *in++ = is_moving(r, i) ? 0 : unknowns[i];
}

static double out_of(const Values *t, const double *w, int k) { return w[t->output[k]]; }

/* Layer, factors, slope and gradients at a point; r->slope is dense. */
static void error_scales(Run *r, const double *x, const double *held, const double *unknowns) {
  const Entries *slope = &r->s->slope;
  set_inputs(r, x, held, unknowns);
  r->stamp++;
  values_at(&r->s->point, r->input, r->p, r->point);
  for (int k = 0; k < slope->count; k++)
    r->slope[slope->row[k] * r->width + slope->column[k]] = out_of(&r->s->point, r->point, 2 * r->width + k);
}
static double layer_of(const Run *r, int i) { return out_of(&r->s->point, r->point, i); }
static double factor_of(const Run *r, int i) { return out_of(&r->s->point, r->point, r->width + i); }

/* Sums over the states of |gradient| times a vector, for each row. ``finite_only`` omits infinite slopes, as of a square
 * root at zero; NaN, as of higher powers there, is always omitted. */
static void gradient_sums(const Run *r, const Values *t, const double *w, int first, const Entries *g, int rows,
                          const double *vector, int finite_only, double *sum) {
  for (int i = 0; i < rows; i++) sum[i] = 0;
  for (int k = 0; k < g->count; k++) {
    double slope = fabs(out_of(t, w, first + k));
    if (slope < INFINITY || (!finite_only && slope == slope)) sum[g->row[k]] += slope * vector[g->column[k]];
  }
}

/* Sums over the states for rows of the layer at the point, and for functions that are kept, after surface_values. */
static void layer_sums(const Run *r, const double *vector, double *sum) {
  int first = 2 * r->width + r->s->slope.count;
  gradient_sums(r, &r->s->point, r->point, first, &r->s->layer_gradient, r->width, vector, 1, sum);
}
static void kept_sums(const Run *r, const double *vector, double *sum) {
  gradient_sums(r, &r->s->surfaces, r->heights, r->kept_rows, &r->s->surface_gradient, r->kept_rows, vector, 1, sum);
}

/* Sizes of the states for rounding, ``near``; rounding in the rows of the layer, in units of epsilon. */
static void weigh_state(const Run *r, const double *x, double *near) {
  for (int i = 0; i < r->n; i++) near[i] = size_of_state(r, i) + fabs(x[i]);
}
static void layer_rounding(Run *r, const double *x, double *sum) {
  double *near = r->vector + r->n + r->width; /* not where inputs are put together */
  weigh_state(r, x, near);
  layer_sums(r, near, sum);
}

static int first_of_factors(const Run *r) {
  const System *s = r->s;
  return 2 * r->width + s->slope.count + s->layer_gradient.count + s->height_gradient.count + s->stop_gradient.count;
}

static void point_sums(const Run *r, int is_free, const double *vector, int finite_only, const Sums *to) {
  const System *s = r->s;
  const Values *t = &s->point;
  int w = r->width, first = 2 * w + s->slope.count, stops = r->s->rules.atoms;
  if (!is_free) gradient_sums(r, t, r->point, first, &s->layer_gradient, w, vector, finite_only, to->layer);
  first += s->layer_gradient.count;
  gradient_sums(r, t, r->point, first, &s->height_gradient, w, vector, finite_only, to->height);
  first += s->height_gradient.count;
  gradient_sums(r, t, r->point, first, &s->stop_gradient, stops, vector, finite_only, to->stop);
  if (!is_free) gradient_sums(r, t, r->point, first_of_factors(r), &s->factor_gradient, w, vector, finite_only, to->factor);
}

/* Error scales of the guards from those of surfaces, of sliding multipliers and of stops. */
static void guard_sums(Run *r, const Expansion *e, const double *vector, int finite_only, double *result) {
  const Layout *l = &e->l;
  int w = r->width, slides = l->slides, stops = r->s->rules.atoms;
  double *layer = r->small, *height = layer + w, *stop = height + w, *through = stop + stops, *factor = through + w;
  double worst = 0;
  Sums of = {layer, height, stop, factor};
  point_sums(r, l->is_free, vector, finite_only, &of);
  if (!l->is_free) {
    for (int again = 0; again < (r->s->combined ? 2 : 1); again++) { /* rows may depend on unknowns only */
      for (int j = 0; j < slides && again; j++)
        for (int k = 0; k < slides; k++) layer[l->sliding[j]] += fabs(r->slope[l->sliding[j] * w + l->sliding[k]]) * through[k];
      for (int i = 0; i < slides; i++) {
        through[i] = 0;
        for (int q = e->from[i]; q < e->to[i]; q++) through[i] += fabs(e->inverse[q]) * layer[l->sliding[e->column[q]]];
      }
    }
    for (int i = 0; r->s->combined && i < r->m; i++)
      for (int k = 0; k < slides && l->letter[i] != 0 && degree_of(r, i) == 0; k++)
        height[i] += fabs(r->slope[i * w + l->sliding[k]]) * through[k];
    for (int i = 0; i < slides; i++) layer[l->sliding[i]] = through[i];
    for (int i = 0; i < r->m; i++) layer[i] += factor[i];
    for (int i = 0; i < w; i++) worst = larger(layer[i], worst);
  }
  for (int row = 0; row < l->rows; row++) {
    int atom = row - l->atoms;
    result[row] = atom < 0 ? law_of(r, l->index[row])->rounding(r, e, row, &of) : atom < stops ? stop[atom]
                  : worst * branch_scale(r, l, row);
  }
}

/* Evaluate the values of an expansion's error scales, with the multipliers of its sets. */
static void weigh_point(Run *r, Expansion *e, const double *x, const double *unknowns) {
  if (e->l.is_free) {
    const double *held = held_of(r, e->l.letter);
    r->stamp++;
    if (r->s->point.free_count) {
      set_inputs(r, x, held, unknowns);
      values_free_at(&r->s->point, r->input, r->p, r->point);
    }
  } else error_scales(r, x, held_of(r, e->l.letter), unknowns);
  e->stamp = r->stamp;
}

/* Evaluate at the state and the unknowns of an expansion again, if other values have been computed since. */
static void weigh_again(Run *r, Expansion *e) {
  double *x = r->vector, *unknowns = x + r->n;
  if (e->stamp == r->stamp) return;
  for (int i = 0; i < r->n; i++) x[i] = e->states[(int64_t)i * r->stride];
  for (int i = 0; i < r->width; i++) unknowns[i] = e->series[(int64_t)i * r->stride];
  aim_again(r, e);
  weigh_point(r, e, x, unknowns);
}

/* The largest of the coefficients k of the states, in units of states. */
static double speed_of(const Run *r, const Expansion *e, int k) {
  double speed = 0;
  for (int i = 0; i < r->n; i++)
    speed = larger(fabs(e->states[(int64_t)i * r->stride + k]) / unit_of_state(r, i), speed);
  return speed;
}

/* Sums for the guards with the sizes of the states for rounding, or with units of states; computed once. */
static const double *sums_once(Run *r, Expansion *e, int by_units, int *is_known, double *sums) {
  if (*is_known) return sums;
  weigh_again(r, e);
  for (int i = 0; i < r->n; i++)
    r->vector[i] = by_units ? unit_of_state(r, i) : size_of_state(r, i) + fabs(e->states[(int64_t)i * r->stride]);
  guard_sums(r, e, r->vector, !by_units, sums);
  *is_known = 1;
  return sums;
}

/* Rounding in the guards in units of epsilon; sums of the magnitudes of their slopes in units of states. */
static const double *scales(Run *r, Expansion *e) { return sums_once(r, e, 0, &e->scaled, e->scale); }
static const double *steepness(Run *r, Expansion *e) { return sums_once(r, e, 1, &e->steepened, e->steep); }
