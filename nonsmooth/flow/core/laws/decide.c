/* The motion that continues from a point where several elements act: lexicographic complementarity.
 *
 * Element i is a surface, a set or a contact. w_i is its row of the layer, the first derivative of its function that
 * contains an unknown (negative for contacts), nu_i its unknown, n_i times lambda_i or the reaction: w = a - A nu, and
 * w_i lies in the normal cone of [-n_i, n_i], of |nu_i| <= n_i for vectors, or of [0, inf), at nu_i. The coefficients of
 * this law are solved order by order (blocks.c), until each element moves inside its set (it slides) or along its bound
 * (it leaves to a side). Once a vector reaches its bound its rows are those along and across it.
 *
 * Source: Acary & Brogliato 2008, Numerical Methods for Nonsmooth Dynamical Systems, chapter 4.
 */

/* The law at a point --------------------------------------------------------------------------------- */

/* Make a negative bound positive by the opposite sign of the unknown. */
static void turn_bound(Decision *d, int i, double *b) {
  int k = d->count;
  double all = *b;
  for (int j = 0; j < k && d->is_shared; j++) if (all == 0) all = d->share[i * k + j];
  if (!(all < 0)) return;
  *b = -*b;
  d->sign[i] = -d->sign[i];
  for (int j = 0; j < k; j++) { d->share[i * k + j] *= -1; d->matrix[j * k + i] *= -1; }
}

/* Edges of the graph: row i of the law contains the unknown j, or they are of one vector. */
static int holds(const Decision *d, int i, int j) {
  if (abs(i - j) == 1 && d->span[i > j ? i : j] < 0) return 1;
  return d->matrix[(int64_t)i * d->count + j] != 0 || (d->is_shared && d->share[(int64_t)i * d->count + j] != 0);
}

/* List them row by row. */
static void list_links(Decision *d) {
  int count = 0;
  for (int i = 0; i < d->count; i++) {
    d->link_at[i] = count;
    for (int j = 0; j < d->count; j++) if (holds(d, i, j)) d->link[count++] = j;
  }
  d->link_at[d->count] = count;
}
#define EACH_LINK(d, i, j) \
  for (int at_link = (d)->link_at[i], j; at_link < (d)->link_at[(i) + 1] && (j = (d)->link[at_link], 1); at_link++)

/* Depth-first search of the strongly connected components (Tarjan 1972), in topological order. */
static void visit(Decision *d, int i, int *time, int *top) {
  int32_t *index = d->mark, *low = index + d->count, *stack = low + d->count, *on = stack + d->count;
  index[i] = low[i] = ++*time;
  stack[(*top)++] = i;
  on[i] = 1;
  EACH_LINK(d, i, j) {
    if (j == i) continue;
    if (!index[j]) { visit(d, j, time, top); if (low[j] < low[i]) low[i] = low[j]; }
    else if (on[j] && index[j] < low[i]) low[i] = index[j];
  }
  if (low[i] != index[i]) return;
  int at = d->first[d->blocks], j;
  do { j = stack[--*top]; on[j] = 0; d->order[at++] = j; } while (j != i);
  for (int a = d->first[d->blocks] + 1; a < at; a++) /* in the order of the elements */
    for (int b = a; b > d->first[d->blocks] && d->order[b] < d->order[b - 1]; b--) {
      int t = d->order[b]; d->order[b] = d->order[b - 1]; d->order[b - 1] = t;
    }
  d->first[++d->blocks] = at;
}

static void find_blocks(Decision *d) {
  int time = 0, top = 0;
  d->blocks = d->first[0] = 0;
  memset(d->mark, 0, sizeof(int32_t) * 4 * d->count);
  for (int i = 0; i < d->count; i++) if (!d->mark[i]) visit(d, i, &time, &top);
  for (int q = 0; q < d->count; q++) d->place[d->order[q]] = q;
}

/* Reactions of joints follow from the other unknowns and are eliminated: row i less the parts ``d->through`` (count, joints)
 * of the joints' rows; ``d->joint`` is the inverse of the joints' own matrix. */
static void read_joints(Run *r, Decision *d) {
  int first = r->m - r->s->joints, n = r->s->joints, w = r->width, k = d->count;
  double *m = d->work, *size = m + n * n, *rest = size + n;
  if (!n) return;
  for (int i = 0; i < n; i++) {
    size[i] = 1;
    for (int j = 0; j < n; j++) m[i * n + j] = r->slope[(first + i) * w + first + j];
  }
  invert_any(m, n, size, d->joint, rest, d->pivot);
  for (int i = 0; i < k; i++)
    for (int j = 0; j < n; j++) {
      double *part = d->through + i * n + j;
      *part = 0;
      for (int q = 0; q < n; q++) *part += r->slope[d->own[i] * w + first + q] * d->joint[q * n + j];
    }
}

/* Rounding of a row with that of the joints. */
static double with_rounding(const Run *r, const Decision *d, int i, const double *of) {
  int first = r->m - r->s->joints;
  double sum = of[d->own[i]];
  for (int j = 0; j < r->s->joints; j++) sum += fabs(d->through[i * r->s->joints + j]) * of[first + j];
  return sum;
}

/* A row of the law with joints eliminated, ``of`` being the rows of all elements. */
static double beside_joints(const Run *r, const Decision *d, int i, const double *of, int64_t apart) {
  int first = r->m - r->s->joints;
  double sum = of[d->own[i] * apart];
  for (int j = 0; j < r->s->joints; j++) sum -= d->through[i * r->s->joints + j] * of[(first + j) * apart];
  return sum;
}

/* Rows and bounds at a point with all active unknowns zero, and rounding in both; 0 where they are not finite. */
static int read_rows(Run *r, Decision *d, const double *x, double *a, double *b, double *floor, double *room) {
  int k = d->count, w = r->width;
  double *near = r->vector + r->n + w, *factor = r->small + w; /* not where inputs are put together */
  aim(r, d->base, x, r->unknowns);
  held_of(r, d->base);
  for (int i = 0; i < k; i++) r->held[r->active[i]] = 0;
  error_scales(r, x, r->held, r->none);
  layer_rounding(r, x, r->small);
  for (int i = 0; i < r->n; i++) near[i] = fabs(x[i]);
  gradient_sums(r, &r->s->point, r->point, first_of_factors(r), &r->s->factor_gradient, w, near, 1, factor);
  read_joints(r, d);
  for (int i = 0; i < w; i++) r->lam[i] = layer_of(r, i);
  for (int i = 0; i < k; i++) {
    int own = r->active[i];
    a[i] = d->turn[i] * beside_joints(r, d, i, r->lam, 1);
    floor[i] = VANISHES * with_rounding(r, d, i, r->small);
    b[i] = d->is_contact[i] || d->is_idle[i] ? 0 : factor_of(r, own);
    room[i] = VANISHES * factor[own];
    if (fabs(b[i]) <= room[i]) b[i] = 0;
    if (!isfinite(a[i]) || !isfinite(b[i])) return 0;
  }
  return 1;
}

/* Dependence of friction's bounds on the reactions, which is affine; negative bounds made positive. */
static void read_shares(Run *r, Decision *d, const double *x) {
  int k = d->count;
  d->is_shared = 0;
  for (int j = 0; j < k; j++) d->is_shared |= d->own[j] >= r->m;
  if (r->c) memset(d->share, 0, sizeof(double) * k * k);
  for (int j = 0; j < k && d->is_shared; j++) {
    int carries = 0;
    for (int i = 0; i < r->m && d->is_contact[j] && d->own[j] >= r->m; i++) carries |= r->s->carries[i * r->c + d->own[j] - r->m];
    if (!carries) continue;
    r->held[d->own[j]] += 1;
    error_scales(r, x, r->held, r->none);
    r->held[d->own[j]] -= 1;
    for (int i = 0; i < k; i++)
      if (!d->is_contact[i] && !d->is_idle[i]) d->share[i * k + j] = factor_of(r, d->own[i]) - d->b[i];
  }
  for (int i = 0; i < k; i++) { d->sign[i] = 1; turn_bound(d, i, d->b + i); }
}

/* The matrix, and its nonzero entries: without joints those of the layer's slope. */
static void read_matrix(Run *r, Decision *d) {
  const Entries *slope = &r->s->slope;
  int k = d->count, w = r->width, joints = r->s->joints;
  int32_t *at = d->mark, *to = d->link_at;
  for (int64_t i = 0; joints && i < (int64_t)k * k; i++)
    d->matrix[i] = d->is_idle[i % k] ? 0 : -d->turn[i / k] * beside_joints(r, d, (int)(i / k), r->slope + d->own[i % k], w);
  if (joints) return;
  memset(d->matrix, 0, sizeof(double) * k * k);
  memset(to, 0, sizeof(int32_t) * (k + 1));
  for (int i = 0; i < w; i++) at[i] = -1;
  for (int i = 0; i < k; i++) at[d->own[i]] = i;
  for (int pass = 0; pass < 2; pass++) {
    for (int e = 0; e < slope->count; e++) { /* column by column */
      int i = at[slope->row[e]], j = at[slope->column[e]];
      if (i < 0 || j < 0 || d->is_idle[j]) continue;
      double of = -d->turn[i] * r->slope[(int64_t)d->own[i] * w + d->own[j]];
      if (of == 0) continue;
      if (pass) d->link[to[i]++] = j;
      else { d->matrix[(int64_t)i * k + j] = of; to[i + 1]++; }
    }
    for (int i = 0; i < k && !pass; i++) to[i + 1] += to[i];
    for (int i = k; i > 0 && pass; i--) to[i] = to[i - 1];
  }
  to[0] = 0;
}

/* Rows, matrix and bounds at the present point; 0 where they are not finite. */
static int read_law(Run *r, Decision *d) {
  int k = d->count;
  memcpy(d->base, d->letter, r->width);
  for (int i = 0; i < k; i++) {
    int own = d->own[i] = r->active[i], set = set_of(r, own);
    d->span[i] = (int8_t)(set < 0 ? 0 : own == set ? size_of(r, own) : -1);
    d->began[i] = 0;
    if (set >= 0) d->base[own] = 0;
    d->is_contact[i] = (int8_t)is_half_line(r, own);
    d->turn[i] = d->is_contact[i] ? -1 : 1;
    d->is_idle[i] = element(r, own)->flags & CONTINUOUS;
  }
  if (!read_rows(r, d, r->x, d->a, d->b, d->floor, d->work)) return 0;
  read_matrix(r, d);
  read_shares(r, d, r->x);
  if (r->s->joints || r->s->sets || d->is_shared) list_links(d);
  for (int i = 0; i < k; i++) EACH_LINK(d, i, j) if (!isfinite(d->matrix[(int64_t)i * k + j])) return 0;
  return 1;
}

/* The unknowns of the previous mode; those whose guard ended it are at their bounds. */
static void read_old(const Run *r, Decision *d, const int8_t *letter, const Known *known, int known_count) {
  int k = d->count;
  for (int i = 0; i < k; i++) {
    d->is_known[i] = 0;
    for (int q = 0; q < known_count; q++) if (known[q].index == element(r, d->own[i])->first) d->is_known[i] = 1;
  }
  for (int contacts = 1; contacts >= 0; contacts--)
    for (int i = 0; i < k; i++) {
      int own = d->own[i], side = letter[own];
      double bound = d->b[i];
      if (d->is_contact[i] != contacts) continue;
      if (d->is_shared) for (int j = 0; j < k; j++) bound += d->share[i * k + j] * d->old[j];
      for (int q = 0; q < known_count; q++) if (known[q].index == own && known[q].kind == EXIT_GUARD) side = known[q].side;
      int is_old = side == 0 && (!d->is_known[i] || d->span[i]);
      d->old[i] = is_old ? d->sign[i] * r->unknowns[own] : d->is_contact[i] || d->span[i] ? 0 : side * bound;
    }
}

/* Whether the old unknown of an element is at its bound, to rounding. */
static int is_at_bound(const Decision *d, int i) {
  double bound = d->b[i];
  if (d->is_contact[i]) return d->old[i] <= TIED * d->room[i];
  if (d->is_shared) for (int j = 0; j < d->count; j++) bound += d->share[i * d->count + j] * d->old[j];
  if (d->span[i]) return d->span[i] > 0 && bound - length_of(d->old + i, d->span[i]) <= TIED * d->room[i];
  return bound - fabs(d->old[i]) <= TIED * d->room[i];
}

/* Find elements of changed components; the others keep their states. */
static void find_touched(Decision *d, const int8_t *letter) {
  int k = d->count, any = 0, changed = 1;
  for (int i = 0; i < k; i++) {
    d->is_touched[i] = d->is_known[i] || letter[d->own[i]] != 0 || is_at_bound(d, i);
    any |= d->is_touched[i];
  }
  if (!any) for (int i = 0; i < k; i++) d->is_touched[i] = 1;
  while (any && changed) {
    changed = 0;
    for (int i = 0; i < k; i++)
      EACH_LINK(d, i, j) if (d->is_touched[i] != d->is_touched[j]) changed = d->is_touched[i] = d->is_touched[j] = 1;
  }
}

/* Orders ------------------------------------------------------------------------------------------------- */

/* Coefficients of an order without its unknowns. */
static void begin_order(Run *r, Expansion *e, int order) {
  for (int i = 0; i < r->active_count; i++) e->series[(int64_t)r->active[i] * r->stride + order] = 0;
  for (int i = r->m - r->s->joints; i < r->m; i++) e->series[(int64_t)i * r->stride + order] = 0;
  open_order(r, e, order);
}

static void begin_orders(Run *r, Decision *d, const int8_t *letter) {
  Expansion *e = &r->trial;
  int w = r->width, stride = r->stride;
  memset(e->series, 0, sizeof(double) * w * stride);
  for (int i = 0; i < r->n; i++) e->states[(int64_t)i * stride] = r->x[i];
  aim(r, letter, r->x, r->unknowns);
  held_of(r, letter);
  for (int i = 0; i < d->count; i++) r->held[d->own[i]] = 0;
  if (!r->s->sets) return;
  memcpy(e->l.letter, letter, w);
  begin_sets(r, e, r->unknowns);
  e->l.mode = -1;
  e->l.is_free = 0;
}

/* Rounding of the states' coefficients and of the rows of each order, with a lower bound where they are zero at rest. */
static void read_noise(Run *r, Decision *d) {
  int k = d->count;
  double *ones = r->vector + r->n + r->width, *steep = r->small, *height = r->rates + r->kept_rows;
  d->field = d->rate = 0;
  for (int i = 0; i < r->n; i++) ones[i] = unit_of_state(r, i);
  error_scales(r, r->x, r->held, r->none);
  layer_sums(r, ones, steep);
  surface_values(r, r->x);
  kept_sums(r, ones, height);
  for (int i = 0; i < k; i++) {
    int own = d->own[i];
    double of = height[degree_of(r, own) > 1 ? element(r, own)->lower + degree_of(r, own) - 2 : own];
    d->steep[i] = with_rounding(r, d, i, steep);
    if (!(of > 0)) continue;
    d->field = larger(d->field, d->yard[i] / of);
    d->rate = larger(d->rate, d->steep[i] / of);
  }
}

/* Rows and bounds of an order after the first. */
static void read_order(Run *r, Decision *d, int order) {
  Expansion *e = &r->trial;
  int k = d->count, w = r->width;
  double speed = speed_of(r, e, order), drift = VANISHES * d->field;
  for (int i = 2; i <= order; i++) drift *= d->rate / i;
  for (int i = 0; i < w; i++) r->lam[i] = row_of(r, r->n + i)[order];
  for (int i = 0; i < k; i++) {
    int at = order * k + i;
    d->a[at] = d->turn[i] * beside_joints(r, d, i, r->lam, 1);
    d->b[at] = d->is_contact[i] || d->is_idle[i] ? 0 : d->sign[i] * row_of(r, r->n + 2 * w + d->own[i])[order];
    d->floor[at] = d->steep[i] * (VANISHES * (order + 1) * speed + drift);
    if (d->state[at] == UNDECIDED && !d->is_contact[i]) turn_bound(d, i, d->b + at);
  }
}

/* Whether an order's rows and bounds are numbers. */
static int is_finite_order(const Decision *d, int order) {
  return finite_all(d->a + order * d->count, d->count) && finite_all(d->b + order * d->count, d->count);
}

/* Replace an order without finite coefficients, as of t^(3/2), by rows and bounds at the shortest time at which they are
 * above rounding; 0 where these are not finite. */
static int read_growth(Run *r, Decision *d, int order) {
  Expansion *e = &r->trial;
  int k = d->count, at = order * k, found = 0;
  double *x = r->at_root, *a = d->work, *b = a + k, *floor = b + k, *room = floor + k, unit = INFINITY;
  for (int i = 0; i < r->n; i++) {
    double *c = e->states + (int64_t)i * r->stride;
    for (int q = 1; q <= order; q++) {
      if (!(fabs(c[q]) < INFINITY)) memset(c + q, 0, sizeof(double) * (order + 1 - q));
      if (c[q] != 0) unit = smaller(unit, pow((fabs(c[0]) + size_of_state(r, i)) / fabs(c[q]), 1.0 / q));
    }
  }
  for (double part = SINGULAR_LONGEST; unit < INFINITY && part > SINGULAR_SHORTEST; part *= SINGULAR_SHORTER) {
    int clear = 1;
    for (int i = 0; i < r->n; i++) x[i] = value_at(e->states + (int64_t)i * r->stride, order, part * unit);
    if (!read_rows(r, d, x, a, b, floor, room)) break;
    for (int i = 0; i < k; i++) {
      double most = larger(fabs(a[i]), fabs(d->matrix[i * (k + 1)] * b[i]));
      clear &= d->state[at + i] >= INSIDE || (most > floor[i] / RESOLVED && !(fabs(b[i]) < room[i] / RESOLVED));
    }
    if (found && !clear) break;
    found = 1;
    memcpy(d->a + at, a, sizeof(double) * k);
    memcpy(d->floor + at, floor, sizeof(double) * k);
    for (int i = 0; i < k; i++) d->b[at + i] = d->sign[i] * b[i];
  }
  for (int i = 0; i < k && found; i++) if (d->state[at + i] == UNDECIDED && !d->is_contact[i]) turn_bound(d, i, d->b + at + i);
  return found;
}

/* Motions ------------------------------------------------------------------------------------------------ */

/* Zeros of several elements tie to the wider tolerance; one element decides by all that is above rounding. */
static double tie_of(const Decision *d) { return d->count > 1 ? TIED : VANISHES; }

/* Sums of products of two coefficients of an order, without the first and the last of one. */
static double middle(const double *one, const double *two, int apart, int other, int order) {
  double sum = 0;
  for (int q = 1; q < order; q++) sum += one[q * apart] * two[(order - q) * other];
  return sum;
}

/* Coefficients of a vector at its bound from the deciding order on: nu = b u, w = s u, |u| = 1, as far as lower orders
 * determine them. Returns the component of u along itself. */
static double along_bound(const Decision *d, int i, int order, double *nu, double *w) {
  int k = d->count, size = d->span[i], j = order - d->began[i];
  const double *b = d->bound + d->began[i] * k + i, *s = d->speed + d->began[i] * k + i, *u = d->along + d->began[i] * k + i;
  double bend = 0;
  for (int q = 0; q < size; q++) bend -= 0.5 * middle(u + q, u + q, k, k, j);
  for (int q = 0; q < size; q++) {
    nu[q] = b[j * k] * u[q] + middle(b, u + q, k, k, j) + b[0] * bend * u[q];
    w[q] = middle(s, u + q, k, k, j) + s[0] * bend * u[q];
  }
  return bend;
}

/* Store the result of an order for a vector, given its first row. */
static void keep_vector(Decision *d, int i, int order) {
  int k = d->count, size = d->span[i], at = order * k, state = d->state[at + k + i];
  if (d->state[at + i] == UNDECIDED) d->began[i] = (int8_t)(order + (state == UNDECIDED));
  if (state == UNDECIDED || state == INSIDE) return;
  int begun = d->began[i] * k + i;
  double w[3], known[3] = {0}, rest[3] = {0}, speed = 0, bend = 0, bound = d->bound[begun], *first = d->along + begun;
  for (int q = 0; q < size; q++) {
    w[q] = d->a[at + i + q];
    for (int c = 0; c < k; c++)
      if (d->matrix[(i + q) * k + c] != 0) w[q] -= d->matrix[(i + q) * k + c] * d->nu[at + c];
  }
  if (order > d->began[i]) bend = along_bound(d, i, order, known, rest);
  else {
    unit_of(bound > 0 ? d->nu + at + i : w, size, first);
    for (int q = 0; q < size; q++) if (fabs(first[q]) <= VANISHES) first[q] = 0;
    axes_of(first, size, d->axes + 3 * i);
  }
  for (int q = 0; q < size; q++) speed += first[q] * (w[q] - rest[q]);
  d->speed[at + i] = state == ABOVE ? speed : 0;
  for (int q = 0; q < size && order > d->began[i]; q++) {
    double across = bound > 0 ? (d->nu[at + i + q] - known[q]) / bound : (w[q] - rest[q] - speed * first[q]) / d->speed[begun];
    d->along[at + i + q] = bend * first[q] + across;
  }
}

/* Give rows of a vector a common rounding, and clear slopes below it where joints allow no slip. */
static void clean_rows(Block *b, int i, int size) {
  double most = 0, floor = largest_of(b->floor + i, size);
  for (int q = 0; q < size; q++) b->floor[i + q] = floor;
  for (int pass = 0; pass < 2; pass++)
    for (int q = 0; q < size; q++)
      for (int c = i; c < i + size; c++) {
        double *of = b->matrix + (i + q) * b->size + c;
        if (pass == 0) most = larger(fabs(*of), most);
        else if (fabs(*of) <= VANISHES * most) *of = 0;
      }
}

/* Rows of a vector at its bound, in axes along and across it: along it is at a bound, across it w keeps its direction. */
static void turn_rows(const Decision *d, Block *b, int i, int order) {
  int n = b->size, own = b->own[i], size = d->span[own];
  const double *axes = d->axes + 3 * own, first = d->bound[d->began[own] * d->count + own];
  double nu[3], w[3], slope = first > 0 ? d->speed[d->began[own] * d->count + own] / first : 0;
  along_bound(d, own, order, nu, w);
  for (int c = 0; c < n; c++) turn_vector(axes, size, 1, b->matrix + i * n + c, n);
  for (int c = 0; c < n; c++) turn_vector(axes, size, 1, b->matrix + c * n + i, 1);
  clean_rows(b, i, size);
  double terms = length_of(b->a + i, size);
  turn_vector(axes, size, 1, b->a + i, 1);
  for (int q = 0; q < size; q++) if (fabs(b->a[i + q]) <= VANISHES * terms) b->a[i + q] = 0;
  turn_vector(axes, size, 1, nu, 1);
  turn_vector(axes, size, 1, w, 1);
  for (int q = 0; q < size; q++) {
    b->b[i + q] = nu[q];
    b->a[i + q] -= w[q] - (q ? slope * nu[q] : 0);
    if (q == 0) continue;
    memset(b->share + (i + q) * n, 0, sizeof(double) * n);
    b->matrix[(i + q) * (n + 1)] += slope;
    b->state[i + q] = first > 0 ? INSIDE : ABOVE;
  }
}

/* A block's part of the law at an order, with terms of earlier blocks. */
static Block part_of_law(Decision *d, int order, int which) {
  int k = d->count, first = d->first[which], n = d->first[which + 1] - first, at = order * k;
  Block b = {.size = n, .tie = tie_of(d), .own = d->order + first, .a = d->block, .state = d->block_state, .is_contact = d->block_state + k};
  int8_t *span = d->block_state + 3 * k;
  b.b = b.a + n; b.floor = b.b + n; b.matrix = b.floor + n; b.share = b.matrix + n * n;
  const double *nu = d->nu + at;
  for (int i = 0; i < n; i++) {
    int own = b.own[i];
    b.a[i] = d->a[at + own];
    b.b[i] = d->b[at + own];
    b.floor[i] = d->floor[at + own];
    b.state[i] = d->state[at + own];
    b.is_contact[i] = d->is_contact[own];
    int earlier = 0;
    EACH_LINK(d, own, j) earlier += d->place[j] < first;
    for (int q = 0; q < first && earlier; q++) {
      int j = d->order[q];
      b.a[i] -= d->matrix[own * k + j] * nu[j];
      if (d->is_shared) b.b[i] += d->share[own * k + j] * nu[j];
    }
    for (int j = 0; j < n; j++) {
      b.matrix[i * n + j] = d->matrix[own * k + b.own[j]];
      b.share[i * n + j] = d->is_shared ? d->share[own * k + b.own[j]] : 0;
      b.is_coupled |= b.share[i * n + j] != 0;
    }
  }
  for (int i = 0; i < n; i++) d->bound[at + b.own[i]] = b.b[i];
  for (int i = 0; i < n; i++) {
    int own = b.own[i], size = d->span[own];
    if (size >= 0) span[i] = 0;
    if (size <= 0) continue;
    clean_rows(&b, i, size);
    if (order > d->began[own]) { /* its rows are like those of other elements */
      memset(span + i, 0, size);
      if (b.state[i] != INSIDE) turn_rows(d, &b, i, order);
      continue;
    }
    memset(span + i, -1, size);
    span[i] = (int8_t)size;
    b.span = span;
  }
  return b;
}

/* Rounding of the unknowns through the inverse matrix, and of the rates by them: a row may depend weakly on its own unknown
 * and on no state, as in a diode bridge. */
static void add_rounding(Decision *d, Block *b) {
  int n = b->size, any = 0;
  double *room = b->share + n * n, *inverse = d->work, *ones = inverse + n * n;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n && b->is_contact[i]; j++)
      any |= fabs(b->matrix[i * (n + 1)]) < WEAK * fabs(b->matrix[i * n + j]) || b->matrix[i * (n + 1)] == 0;
  if (n < 2 || !any) return;
  for (int i = 0; i < n; i++) ones[i] = 1;
  if (!invert_any(b->matrix, n, ones, inverse, ones + n, d->pivot)) return;
  for (int i = 0; i < n; i++) {
    room[i] = 0;
    for (int j = 0; j < n; j++) room[i] += fabs(inverse[i * n + j]) * b->floor[j];
  }
  for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) b->floor[i] += fabs(b->matrix[i * n + j]) * room[j];
  b->room = room;
}

/* Certificate of each block, computed once, or after its vectors have been turned. */
static int certificate_of(Decision *d, const Block *b, int which) {
  int has_vectors = 0;
  for (int i = 0; i < b->size; i++) has_vectors |= d->span[b->own[i]];
  if (d->proved[which] < 0 || has_vectors)
    d->proved[which] = b->is_coupled ? NOTHING : certificate(b->matrix, b->size, b->span, d->work, d->pivot);
  return d->proved[which];
}

/* End the run where the friction matrix is indefinite. */
static void refuse_negative(Run *r, const Block *b) {
  double own[9];
  for (int i = 0; i < b->size; i++) {
    int size = b->span[i];
    for (int j = 0; j < size * size; j++) own[j] = b->matrix[(i + j / size) * b->size + i + j % size];
    if (size > 0 && b->b[i] > 0 && largest_of(own, size * size) > 0 && !is_vector_definite(own, size, -LAYER_ROUNDING))
      finish(r, NON_UNIQUE, INDEFINITE, r->decision->own[b->own[i]]);
  }
}

/* Relative distance at which one of many solutions counts as at a bound: 0 where it is inside all bounds by more than
 * ``part``; else it separates reactions far closer to theirs than the others, which become zero. */
static double find_tight(const Block *b, double *nu, double part) {
  double most = 0;
  int is_tight = 0;
  for (int i = 0; i < b->size; i++) if (b->is_contact[i]) most = larger(nu[i], most);
  for (int i = 0; i < b->size; i++) /* vectors are left where none of their loads can be less */
    is_tight |= b->is_contact[i] ? nu[i] <= part * most : !b->span && bound_of(b, i, nu) - fabs(nu[i]) <= part * bound_of(b, i, nu);
  if (!is_tight) return 0;
  for (int i = 0; i < b->size; i++) if (b->is_contact[i] && nu[i] <= sqrt(part) * most) nu[i] = 0;
  return sqrt(part);
}

/* Whether vectors of a block were not held before: what sticks stays so as loads change. */
static int comes_to_rest(const Run *r, const Decision *d, const Block *b) {
  int rests = 0;
  for (int i = 0; i < b->size; i++) rests |= b->span[i] > 0 && r->letter[d->own[b->own[i]]] != 0;
  return rests && !d->is_imposed;
}

/* Solutions of a block at an order; if the previous unknowns are one, the guard decides its element. */
static int solutions_of(Run *r, Decision *d, int order, int which, double *found, int8_t *class) {
  Block b = part_of_law(d, order, which);
  int n = b.size, count;
  b.is_joined = r->s->joints > 0;
  b.may_end = b.span && order == 0 && d->ended <= which;
  add_rounding(d, &b);
  int8_t *position = b.is_contact + d->count;
  for (int i = 0; i < n; i++) {
    int letter = d->letter[d->own[b.own[i]]], is_open = b.is_contact[i] && letter;
    position[i] = letter == 0 && !d->is_known[b.own[i]] ? HELD : letter > 0 && !is_open ? TOP : BOTTOM;
    if (!allows(&b, i, position[i])) position[i] = allows(&b, i, HELD) ? HELD : allows(&b, i, TOP) ? TOP : BOTTOM;
  }
  if (order == 0 && !d->is_touched[b.own[0]]) {
    for (int i = 0; i < n; i++) { found[i] = d->old[b.own[i]]; class[i] = INSIDE; }
    return 1;
  }
  count = n == 1 ? solve_single(&b, found)
                 : solve_block_of_many(&b, certificate_of(d, &b, which), position, found, d->work, d->pivot);
  if (count == 1 && order == 0 && b.span && b.is_coupled && 2 * n <= SOLUTIONS_ROOM && comes_to_rest(r, d, &b))
    count += slip_beside(&b, found, found + n, d->work, d->pivot);
  if (n > MOST_ENUMERATED && d->proved[which] == NOTHING && order == 0) r->facts |= UNPROVED;
  if (b.span && d->proved[which] == NOTHING && !d->is_imposed) refuse_negative(r, &b);
  for (int q = 0; q < count; q++) {
    double *nu = found + q * n, terms;
    int agrees = order == 0;
    for (int i = 0; i < n && agrees; i++) {
      double miss = 0;
      rate_of(&b, i, nu, &terms);
      for (int j = 0; j < n; j++) miss += b.matrix[i * n + j] * (nu[j] - d->old[b.own[j]]);
      agrees = fabs(miss) <= larger(KNOWN_TO * r->o.rtol * terms, zero_of(&b, i, terms));
    }
    int is_dependent = 0, contacts = 0; /* one of many solutions is at its bound; of contacts, all */
    for (int i = 0; i < n && n > 1; i++) {
      is_dependent |= d->is_known[b.own[i]] && d->proved[which] < UNIQUE;
      contacts |= b.is_contact[i];
    }
    double loose = KNOWN_TO * r->o.rtol;
    if (agrees && is_dependent && contacts) loose = find_tight(&b, nu, loose);
    for (int i = 0; i < n; i++) {
      int is_loose = agrees && (is_dependent ? contacts : d->is_known[b.own[i]]), own = b.own[i], size = d->span[own];
      double part = is_loose && (contacts || !(is_dependent && b.span)) ? loose : 0; /* loads are redistributed */
      class[q * n + i] = (int8_t)(size < 0 ? class[q * n + i - 1] : span_of(&b, i) ? class_of_vector(&b, i, nu, part)
                                                                                   : class_of(&b, i, nu, part));
    }
    if (b.may_end && d->proved[which] < UNIQUE && is_at_limit(&b, nu, d->work, d->pivot)) {
      for (int i = 0; i < n; i++) class[i] = AT_TOP;
      d->ending = which + 1;
    }
    for (int i = 0; i < n; i++) { /* back from the axes in which it was solved */
      int own = b.own[i];
      if (d->span[own] > 0 && order > d->began[own] && b.state[i] != INSIDE) turn_vector(d->axes + 3 * own, d->span[own], 0, nu + i, 1);
    }
  }
  return count;
}

/* Stability ---------------------------------------------------------------------------------------------- */

/* Whether all eigenvalues have positive real parts: powers of (A + c)^-1 (A - c) vanish. A is overwritten. */
static int is_positive_stable(double *a, int n, double *work) {
  double c = sqrt(dot(a, a, n * n) / n), *inverse = work, *power = inverse + (int64_t)n * n, *next = power + (int64_t)n * n;
  if (n == 1) return a[0] > 0;
  memcpy(next, a, sizeof(double) * n * n);
  for (int i = 0; i < n; i++) { a[i * n + i] += c; next[i * n + i] -= c; }
  if (!(c > 0) || !invert(a, n, inverse)) return 0;
  multiply(inverse, next, n, power);
  for (int again = 0; again < DEPTH; again++) {
    if (!finite_all(power, n * n)) return 0;
    if (largest_of(power, n * n) < TIED) return 1;
    multiply(power, power, n, next);
    double *t = power; power = next; next = t;
  }
  return 0;
}

/* The state of an element after some orders. An undecided one has nu at its bound and w = 0: sliding and leaving are then
 * the same motion, except where nu does not act. */
static int final_state(const Decision *d, int i, int orders) {
  int state = d->state[orders * d->count + i];
  int first = first_row(d->span, i), end = first + (d->span[first] > 1 ? d->span[first] : 1), matters = d->is_contact[i] || d->is_idle[i];
  if (state >= INSIDE) return state;
  for (int j = first; j < end; j++) matters |= d->matrix[j * (d->count + 1)] != 0;
  if (matters) return INSIDE;
  return state == AT_TOP ? ABOVE : state == AT_BOTTOM ? BELOW : INSIDE;
}

/* The matrix of the sliding surfaces of a block, and bounds over widths of their layers; its size. */
static int layer_matrix(const Run *r, const Decision *d, int which, int orders, double *a, double *weight) {
  int k = d->count, n = 0;
  int32_t *own = d->pivot;
  for (int q = d->first[which]; q < d->first[which + 1]; q++) {
    int i = d->order[q];
    if (!d->is_contact[i] && d->state[orders * k + i] == UNDECIDED) continue; /* its bound is zero: no friction */
    if (final_state(d, i, orders) == INSIDE && !d->is_contact[i] && !d->is_idle[i]) own[n++] = i;
  }
  for (int i = 0; i < n; i++) {
    double bound = d->b[own[i]];
    if (d->is_shared) for (int j = 0; j < k; j++) bound += d->share[own[i] * k + j] * d->nu[j];
    weight[i] = (bound > 0 ? bound : 1) / element(r, d->own[own[i]])->width;
    for (int j = 0; j < n; j++) a[i * n + j] = d->matrix[own[i] * k + own[j]];
  }
  return n;
}

/* Shift eigenvalues that are zero because elements are dependent: they do not affect the motion. */
static void lift_null_space(double *a, int n, double *work, int32_t *pivot) {
  double *z = work, *rest = z + (int64_t)n * n, most = largest_of(a, n * n);
  int count = null_space(a, n, n, z, rest, pivot);
  for (int l = 0; l < count; l++) {
    double *own = z + (int64_t)l * n;
    if (!orthonormal(own, z, l, n, 1)) continue;
    for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) a[i * n + j] += most * own[i] * own[j];
  }
}

/* Whether the sliding of a block is stable across its layers; dependence on their widths is noted. */
static int is_stable_block(Run *r, Decision *d, int which, int orders) {
  int size = d->first[which + 1] - d->first[which];
  if (d->is_imposed || !d->is_touched[d->order[d->first[which]]] || d->proved[which] == UNIQUE_AND_STABLE) return 1;
  double *a = d->block, *weight = a + (int64_t)size * size, *scaled = weight + size, *rest = scaled + (int64_t)size * size;
  int n = layer_matrix(r, d, which, orders, a, weight), stable, falling = 0;
  if (n == 0) return 1;
  if (n == 1) return a[0] > 0;
  int proved = certificate(a, n, 0, d->work, d->pivot), moves = 0, turns = 1; /* orbits that only turn: no trace */
  for (int i = 0; i < n * n; i++) moves |= a[i] != 0;
  for (int i = 0; i < n; i++) turns &= moves && a[i * n + i] == 0;
  if (proved == UNIQUE_AND_STABLE || (proved == SEMIDEFINITE && !turns)) return 1;
  for (int i = 0; i < n; i++) {
    falling += !(a[i * n + i] > 0);
    for (int j = 0; j < n; j++) scaled[i * n + j] = weight[i] * a[i * n + j];
  }
  double determinant = n == 2 ? a[0] * a[3] - a[1] * a[2] : 1;
  lift_null_space(scaled, n, rest, d->pivot);
  stable = is_positive_stable(scaled, n, rest);
  int for_all = r->s->sets && element(r, d->own[d->order[d->first[which]]])->k == n ? 1 : n == 2 ? determinant <= 0 || (a[0] >= 0 && a[3] >= 0 && a[0] + a[3] > 0) || falling == 2 : !stable && falling == n;
  if (!for_all) r->facts |= DEPENDS_ON_WIDTHS;
  return stable;
}

/* Add a motion with decided letters, unless its sliding is unstable. */
static void add_motion(Run *r, Decision *d, int orders) {
  int k = d->count;
  for (int q = 0; q < d->blocks; q++) if (!is_stable_block(r, d, q, orders)) { d->unstable++; return; }
  if (d->motions == SEVERAL) return;
  Motion *own = d->motion + d->motions++;
  for (int i = 0; i < k; i++) {
    int order = 0;
    while (order < orders && d->state[(order + 1) * k + i] < INSIDE) order++;
    own->order[i] = (int8_t)(order < orders ? order : r->order + 1);
    if (d->span[i] && d->state[orders * k + i] == INSIDE) own->order[i] = (int8_t)(own->order[i] + d->began[first_row(d->span, i)]); /* of squares */
    own->before[i] = order ? d->state[(order < orders ? order : orders) * k + i] : UNDECIDED;
    own->state[i] = (int8_t)final_state(d, i, orders);
    own->nu[i] = d->span[i] && own->state[i] == ABOVE ? d->along[d->began[first_row(d->span, i)] * k + i] : d->sign[i] * d->nu[i];
  }
  orders -= d->last == orders - 1; /* what grew decided: it has no coefficients */
  own->terms = orders < COMPARED ? orders : COMPARED;
  for (int i = 0; i < r->n; i++)
    for (int j = 1; j <= own->terms; j++)
      own->series[i * COMPARED + j - 1] = r->trial.states[(int64_t)i * r->stride + j];
}

/* Coefficients of the joints' reactions that keep them with the other unknowns. */
static void hold_joints_in(Run *r, const Decision *d, Expansion *e, int order) {
  int first = r->m - r->s->joints, n = r->s->joints;
  for (int i = 0; i < n; i++) {
    double sum = 0;
    for (int j = 0; j < n; j++) sum += d->joint[i * n + j] * row_of(r, r->n + first + j)[order];
    e->series[(int64_t)(first + i) * r->stride + order] = -sum;
  }
  close_order(r, e, order);
}

/* Close an order with the unknowns that were found. */
static void close_with(Run *r, Decision *d, int order) {
  Expansion *e = &r->trial;
  if (order == 0) { begin_orders(r, d, d->base); begin_order(r, e, 0); }
  for (int i = 0; i < d->count; i++)
    e->series[(int64_t)d->own[i] * r->stride + order] = d->sign[i] * d->nu[order * d->count + i];
  close_order(r, e, order);
  if (r->s->joints) hold_joints_in(r, d, e, order);
  if (r->s->sets) close_sets(r, e, order);
  next_states(r, e, order);
}

/* Take a solution of a block at an order. */
static void take_solution(Decision *d, int order, int which, const double *nu, const int8_t *class) {
  int k = d->count, at = order * k, n = d->first[which + 1] - d->first[which];
  const int32_t *own = d->order + d->first[which];
  for (int i = 0; i < n; i++) {
    d->nu[at + own[i]] = nu[i];
    d->state[at + k + own[i]] = class[i];
  }
  for (int i = 0; i < n; i++) {
    d->bound[at + own[i]] = d->b[at + own[i]];
    for (int j = 0; j < d->first[which + 1] && d->is_shared; j++) d->bound[at + own[i]] += d->share[own[i] * k + d->order[j]] * d->nu[at + d->order[j]];
  }
  for (int i = 0; i < n; i++) if (d->span[own[i]] > 0) keep_vector(d, own[i], order);
}

/* What the solution of a block says of its elements: those that move leave a limit that others hold. */
static void classes_of(const Block *b, const double *nu, int8_t *class) {
  for (int i = 0; i < b->size; i++)
    class[i] = (int8_t)(span_of(b, i) < 0 ? class[i - 1] : span_of(b, i) ? class_of_vector(b, i, nu, 0) : class_of(b, i, nu, 0));
}

/* A block holds no longer than up to this instant, and its unknowns need not be unique until then. As the law goes on in
 * time, with rates of order 1, so do its solutions; those of order 0 are their limit, by polynomials through some of them,
 * and those of order 1 its derivative. 0 where there is none. */
static int leave_limit(Decision *d, int which, int order) {
  Block b = part_of_law(d, 0, which);
  int n = b.size, k = d->count, jumps = 0, levels = 0;
  double *a = d->work, *bound = a + n, *rate = bound + n, *slope = rate + n, *table = slope + n, *work = table + LIMITS * n;
  double step = INFINITY, most = 0, terms;
  int8_t *class = b.is_contact + k, *first = d->large_class;
  memcpy(a, b.a, sizeof(double) * n);
  memcpy(bound, b.b, sizeof(double) * n);
  memset(class, INSIDE, n);
  for (int i = 0; i < n; i++) {
    int own = b.own[i];
    rate[i] = d->a[k + own];
    slope[i] = d->b[k + own];
    for (int q = 0; q < d->first[which]; q++) {
      rate[i] -= d->matrix[own * k + d->order[q]] * d->nu[k + d->order[q]];
      if (d->is_shared) slope[i] += d->share[own * k + d->order[q]] * d->nu[k + d->order[q]];
    }
    table[i] = d->nu[own];
    most = larger(most, larger(fabs(table[i]), bound[i]));
    if (rate[i] != 0) step = smaller(step, RESOLVED * d->yard[own] / fabs(rate[i]));
    if (slope[i] != 0) step = smaller(step, RESOLVED * fabs(bound[i] / slope[i]));
  }
  for (int again = 0; step < INFINITY && levels < LIMITS && again < 4 * LIMITS; again++, step /= 2) {
    double *nu = table + levels * n;
    if (again) memcpy(nu, table + (levels ? levels - 1 : 0) * n, sizeof(double) * n);
    for (int i = 0; i < n; i++) { b.a[i] = a[i] + step * rate[i]; b.b[i] = bound[i] + step * slope[i]; }
    if (!(levels && polish(&b, nu, most, work, d->pivot)) && !relax_from(&b, nu, most, work, d->pivot)) return 0;
    classes_of(&b, nu, class);
    if (levels && memcmp(class, first, n)) { memcpy(table, nu, sizeof(double) * n); levels = 0; }
    memcpy(first, class, n);
    levels++;
  }
  memcpy(b.a, a, sizeof(double) * n);
  memcpy(b.b, bound, sizeof(double) * n);
  if (step < INFINITY && levels < LIMITS) return 0;
  double *nu = table + (levels ? levels - 1 : 0) * n, *last = a, shortest = 2 * step;
  memcpy(last, nu, sizeof(double) * n);
  memcpy(first, class, n);
  for (int j = 1; j < levels; j++)
    for (int l = levels - 1; l >= j; l--)
      for (int i = 0; i < n; i++) table[l * n + i] += (table[l * n + i] - table[(l - 1) * n + i]) / ((1 << j) - 1);
  for (int i = 0; i < n; i++) jumps |= fabs(rate_of(&b, i, nu, &terms)) > MERGED * terms;
  if (jumps && !polish(&b, nu, most, work, d->pivot)) return 0;
  if (jumps) classes_of(&b, nu, class);
  for (int i = 0; i < n && !jumps; i++) {
    double room = MERGED * most;
    if (!levels) break;
    if (b.is_contact[i]) class[i] = class[i] == BELOW || nu[i] <= room ? AT_BOTTOM : INSIDE;
    else if (span_of(&b, i) >= 0 && bound_of(&b, i, nu) <= room) class[i] = UNDECIDED;
    else if (span_of(&b, i) < 0) class[i] = class[i - 1];
    else class[i] = class[i] == ABOVE ? AT_TOP : class[i] == BELOW ? AT_BOTTOM : class[i];
    if (class[i] == UNDECIDED || (b.is_contact[i] && class[i] == AT_BOTTOM)) nu[i] = 0;
  }
  take_solution(d, 0, which, nu, class);
  if (order == 0) return 1;
  for (int i = 0; i < n; i++) nu[i] = levels ? (last[i] - nu[i]) / shortest : 0;
  take_solution(d, 1, which, nu, first);
  return 1;
}

/* Follow all solutions from a block of an order on. */
static void explore(Run *r, Decision *d, int order, int which) {
  int k = d->count;
  Expansion *e = &r->trial;
  double found[SOLUTIONS_ROOM];
  int8_t class[SOLUTIONS_ROOM];
  while (d->motions < SEVERAL) {
    if (which == d->blocks) {
      int open = 0, more = order < (d->branches ? COMPARED : 0) - 1;
      for (int i = 0; i < k; i++) open |= d->state[(order + 1) * k + i] < INSIDE;
      if (order == d->last) { add_motion(r, d, order + 1); return; }
      if ((!open && !more) || order + 1 == ORDERS || order + 1 >= r->order) { /* the series is closed if it is compared */
        if (d->branches) close_with(r, d, order);
        add_motion(r, d, order + 1);
        return;
      }
      close_with(r, d, order);
      if (++order == 1) read_noise(r, d);
      begin_order(r, e, order);
      read_order(r, d, order);
      d->last = is_finite_order(d, order) ? ORDERS : order;
      if (d->last == order && !open) { add_motion(r, d, order); return; }
      if (d->last == order && !read_growth(r, d, order)) return;
      which = 0;
      continue;
    }
    if (order == 1 && (d->ending == which + 1 || d->ended == which + 1)) {
      int again = d->ended != which + 1; /* the order before is taken anew */
      if (!leave_limit(d, which, !again)) return;
      d->ended = which + 1;
      d->ending = 0;
      order = !again;
      which++;
      continue;
    }
    int n = d->first[which + 1] - d->first[which], is_large = 2 * n > SOLUTIONS_ROOM;
    double *nu = is_large ? d->large : found;
    int8_t *to = is_large ? d->large_class : class;
    int count = solutions_of(r, d, order, which, nu, to);
    if (count > 1) d->branches++;
    for (int q = 0; q < count; q++) {
      take_solution(d, order, which, nu + q * n, to + q * n);
      if (count > 1) explore(r, d, order, which + 1);
    }
    if (count != 1) return;
    which++;
  }
}

/* Whether two motions are equal, by their series. */
static int is_same_motion(const Run *r, const Motion *one, const Motion *two) {
  int terms = one->terms < two->terms ? one->terms : two->terms;
  for (int j = 0; j < terms; j++) {
    double most = 0;
    for (int i = 0; i < r->n; i++)
      most = larger(most, larger(fabs(one->series[i * COMPARED + j]), fabs(two->series[i * COMPARED + j])));
    for (int i = 0; i < r->n; i++)
      if (fabs(one->series[i * COMPARED + j] - two->series[i * COMPARED + j]) > MERGED * most) return 0;
  }
  return 1;
}

/* Letters of a motion. */
static void letters_of_motion(const Run *r, const Decision *d, const Motion *own, int8_t *letter) {
  memcpy(letter, d->letter, r->width);
  for (int i = 0; i < d->count; i++) {
    int side = own->state[i] == INSIDE ? 0 : own->state[i] == ABOVE ? 1 : -1;
    letter[d->own[i]] = (int8_t)(d->span[i] && side ? LEAVING : d->is_contact[i] ? side != 0 : side);
  }
  if (r->s->sets) idle_sets(r, letter, 0);
}

/* Whether a block may have more than one vector of unknowns. */
static int may_depend(const Decision *d) {
  for (int q = 0; q < d->blocks; q++)
    if (d->first[q + 1] - d->first[q] > 1 && d->proved[q] >= 0 && d->proved[q] < UNIQUE) return 1;
  return 0;
}

/* Whether the field is the same for all unknowns of a mode that keep its surfaces, r->slope having no inverse. */
static int is_determined(Run *r, const Layout *l, const int8_t *letter) {
  int n = l->slides, w = r->width;
  double *m = r->decision->work, *z = m + (int64_t)n * n, *rest = z + (int64_t)n * n, *change = r->vector;
  for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) m[i * n + j] = r->slope[l->sliding[i] * w + l->sliding[j]];
  int count = null_space(m, n, n, z, rest, r->decision->pivot);
  set_inputs(r, r->x, held_of(r, letter), r->none);
  values_at(&r->s->columns, r->input, r->p, r->columns);
  const Entries *column = &r->s->column;
  for (int q = 0; q < count; q++) {
    double *terms = change + r->n, most = largest_of(z + (int64_t)q * n, n);
    for (int i = 0; i < 2 * r->n; i++) change[i] = 0;
    for (int e = 0; e < column->count; e++)
      for (int j = 0; j < n; j++) {
        if (l->sliding[j] != column->column[e]) continue;
        double of = out_of(&r->s->columns, r->columns, e);
        change[column->row[e]] += of * z[(int64_t)q * n + j];
        terms[column->row[e]] += fabs(of) * most; /* not of what rounding has left of z */
      }
    for (int i = 0; i < r->n; i++) if (fabs(change[i]) > MERGED * terms[i]) return 0;
  }
  return 1;
}

/* Note a mode with undetermined unknowns; whether the motion is still unique. */
static int find_dependent(Run *r, const Layout *l, const int8_t *letter, const double *unknowns) {
  aim(r, letter, r->x, unknowns);
  error_scales(r, r->x, held_of(r, letter), unknowns);
  if (l->slides < 2 || invert_layer(r, l, unknowns, r->matrix)) return 1;
  r->dependent = l->mode;
  return is_determined(r, l, letter);
}

/* Unknowns of a mode that keep its functions at zero; bounds that were reached to a tolerance become exact. 0 where the run
 * ends. */
static int hold(Run *r, Continuation *to, int may_depend) {
  Layout *l = &r->trial.l;
  lay_out(r, to->letter, l);
  if ((may_depend || r->s->joints) && !find_dependent(r, l, to->letter, to->unknowns))
    finish(r, NON_UNIQUE, UNDETERMINED_RATES, 0);
  if (l->slides && !improve(r, l, r->x, to->unknowns, 1) && r->s->joints) finish(r, INCONSISTENT, DEAD_POINT, 0);
  return r->status == RUNNING;
}

/* The position of an element among the active ones, which are in order, or -1. */
static int position_of(const Decision *d, int element) {
  int low = 0, high = d->count;
  while (low < high) {
    int middle = (low + high) / 2;
    if (d->own[middle] < element) low = middle + 1;
    else high = middle;
  }
  return low < d->count && d->own[low] == element ? low : -1;
}

/* The mode of a motion to r->chosen, with the zeros of its guards. */
static void choose_motion(Run *r, const Decision *d, const Motion *own) {
  Continuation *to = &r->chosen;
  Layout *l = &r->trial.l;
  letters_of_motion(r, d, own, to->letter);
  keep_carried(r, to->letter, to->unknowns);
  for (int i = 0; i < d->count; i++)
    if (to->letter[d->own[i]] == LEAVING || (to->letter[d->own[i]] == 0 && !is_idle(r, to->letter, d->own[i])))
      to->unknowns[d->own[i]] = own->nu[i];
  if (!hold(r, to, may_depend(d))) return;
  memset(to->drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < l->rows; row++) {
    int kind = l->kind[row], of = l->index[row], is_off = kind == SURFACE_GUARD || kind == IMPACT_GUARD || kind == NEAR_GUARD;
    if (kind == NEAR_GUARD && to->letter[of] == 0) continue; /* ends steps only */
    int i = row < l->atoms ? position_of(d, of) : -1;
    if (i >= 0) {
      int both = kind == RELEASE_GUARD || own->before[i] == UNDECIDED || is_idle(r, to->letter, of);
      int near = both || own->before[i] == (l->side[row] < 0 ? AT_BOTTOM : AT_TOP);
      to->drop[row] = is_off ? own->order[i] + degree_of(r, of) : near ? own->order[i] : 0;
    }
  }
}

/* Sizes of multipliers of complementarity conditions, if all elements are such: from their solution, as estimates by a
 * small diagonal are far too large. */
static void estimate_multipliers(const Run *r, Decision *d) {
  int k = d->count;
  double *nu = d->large, *q = d->block, *m = q + k;
  for (int i = 0; i < k; i++) {
    if (!has_law(r, d->own[i], COMPLEMENTARITY_LAW)) return;
    q[i] = -d->a[i];
  }
  memcpy(m, d->matrix, sizeof(double) * k * k);
  if (k > 1 && lemke_scaled(m, q, k, nu, d->work, d->pivot)) memcpy(d->room, nu, sizeof(double) * k);
}

/* Scales of the law at the point. */
static void begin_decision(const Run *r, Decision *d) {
  int k = d->count;
  d->most = 0;
  for (int i = 0; i < k; i++) { /* what reactions can be, then rows */
    double own = fabs(d->matrix[i * (k + 1)]);
    d->room[i] = d->is_contact[i] ? own > 0 ? fabs(d->a[i]) / own : 0 : fabs(d->b[i]);
    EACH_LINK(d, i, j) d->most = larger(fabs(d->matrix[i * k + j]), d->most);
  }
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k && d->is_shared && !d->is_contact[i]; j++) d->room[i] += fabs(d->share[i * k + j]) * d->room[j];
  estimate_multipliers(r, d);
  for (int i = 0; i < k; i++) {
    d->yard[i] = fabs(d->a[i]);
    EACH_LINK(d, i, j) d->yard[i] += fabs(d->matrix[i * k + j]) * d->room[j];
    d->floor[i] = larger(d->floor[i], tie_of(d) * d->yard[i]);
    d->state[i] = UNDECIDED;
  }
  for (int q = 0; q < d->blocks; q++) d->proved[q] = -1;
}

/* One surface ------------------------------------------------------------------------------------------- */

/* Whether a surface's row of the layer contains its own unknown. */
static int holds_its_own(const Run *r, int surface) {
  const Entries *slope = &r->s->slope;
  for (int e = 0; e < slope->count; e++) if (slope->row[e] == surface && slope->column[e] == surface) return 1;
  return 0;
}

/* The rate of h on one side of a surface, and rounding in it. */
static double rate_on_side(Run *r, const int8_t *letter, int surface, int side, double *rounding) {
  held_of(r, letter);
  r->held[surface] = side;
  error_scales(r, r->x, r->held, r->none);
  layer_rounding(r, r->x, r->small);
  *rounding = r->small[surface];
  return layer_of(r, surface);
}

/* Both fields tangent to a surface at the present point, and the sliding field 0/0. */
static int is_two_fold(Run *r, const int8_t *letter, int surface, double tolerance) {
  if (element(r, surface)->flags & CONTINUOUS || degree_of(r, surface) > 1 || !holds_its_own(r, surface)) return 0;
  if (r->s->joints) return 0;
  aim(r, letter, r->x, r->unknowns);
  for (int side = 1; side >= -1; side -= 2) {
    double rounding, rate = rate_on_side(r, letter, surface, side, &rounding);
    if (is_scaled(r, surface) && r->slope[surface * r->width + surface] != 0) return 0;
    if (!(fabs(rate) <= (tolerance + TANGENT) * rounding)) return 0; /* or zero everywhere */
  }
  return 1;
}

/* Decide one active surface by the rates of h on both sides: crossing, entry, and exit where the multiplier is known to pass
 * its bound. The choice to r->chosen; 0 where series are needed. */
static int decide_by_rates(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int own = r->active[0], exits = known_count && known[0].kind == EXIT_GUARD, chosen = 0;
  double rate[2], rounding;
  if (!has_law(r, own, SURFACE_LAW) || !r->s->affine || r->s->joints || is_scaled(r, own) || is_idle(r, letter, own)) return 0;
  if (known_count && !(exits && r->falls)) return 0;
  aim(r, letter, r->x, r->unknowns);
  for (int q = 0; q < 2; q++) {
    rate[q] = rate_on_side(r, letter, own, q ? 1 : -1, &rounding);
    if (!(fabs(rate[q]) > (VANISHES + TANGENT) * rounding && fabs(rate[q]) < INFINITY)) rate[q] = 0;
  }
  if (exits) { /* the other side still leads onto the surface; the rate of this one is zero */
    chosen = known[0].side;
    if (!(rate[chosen < 0] * chosen > 0)) return 0;
  } else if (rate[0] * rate[1] > 0) chosen = rate[0] > 0 ? 1 : -1;
  else if (!(rate[0] > 0 && rate[1] < 0)) return 0;
  Layout *l = &r->trial.l;
  memcpy(r->chosen.letter, letter, r->width);
  r->chosen.letter[own] = (int8_t)chosen;
  keep_carried(r, r->chosen.letter, r->chosen.unknowns);
  lay_out(r, r->chosen.letter, l);
  if (l->slides && !improve(r, l, r->x, r->chosen.unknowns, 1)) return 0;
  memset(r->chosen.drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < l->rows; row++)
    if (l->kind[row] == SURFACE_GUARD && l->index[row] == own) r->chosen.drop[row] = degree_of(r, own) + exits;
  return 1;
}

/* No mode continues: stay where all orbits spiral in, or set the reason why the run ends. */
static int no_motion(Run *r, const int8_t *letter) {
  int contacts = 0, sets = 0, k = r->active_count;
  for (int i = 0; i < k; i++) { contacts |= is_half_line(r, r->active[i]); sets |= set_of(r, r->active[i]) >= 0; }
  if (r->status != RUNNING) return 0;
  if (contacts) finish(r, INCONSISTENT, NO_REACTION, 0);
  else if (sets) finish(r, NON_UNIQUE, UNDETERMINED, 0);
  else if (k == 2 && spirals_in(r, letter) && hold_there(r, letter)) return 1;
  else if (k > 1) finish(r, INTERSECTION, NO_STABLE_MOTION, 0);
  else finish(r, NON_UNIQUE, DEGENERATE, 0);
  return 0;
}

/* The law of the active elements at the present point; 0 where it is not finite. */
static int begin_law(Run *r, const int8_t *letter, const Known *known, int known_count) {
  Decision *d = r->decision;
  d->count = r->active_count;
  d->letter = letter;
  d->motions = d->branches = d->unstable = d->is_imposed = d->ending = d->ended = 0;
  d->last = ORDERS;
  if (!read_law(r, d)) return 0;
  find_blocks(d);
  begin_decision(r, d);
  read_old(r, d, letter, known, known_count);
  find_touched(d, letter);
  return 1;
}

/* Whether multipliers of a motion are not determined at the order where they enter: the closed conditions are dependent, or
 * leave equations of the states. */
static int has_hidden(Run *r, const Decision *d) {
  if (!r->s->combined || r->status != RUNNING) return 0;
  for (int i = 0; i < d->motions; i++) {
    letters_of_motion(r, d, d->motion + i, r->found.letter);
    combine_rows(r, r->found.letter, r->x);
    lay_out(r, r->found.letter, &r->trial.l);
    error_scales(r, r->x, held_of(r, r->found.letter), r->none);
    if (r->equations.dependent || !invert_layer(r, &r->trial.l, r->none, r->matrix)) return 1;
  }
  return d->motions != 1;
}

/* Choose the motion that continues from a point of the active elements as r->chosen; 0 if the run ends. ``letter`` has the
 * letters of the other elements. */
static int decide(Run *r, const int8_t *letter, const Known *known, int known_count) {
  Decision *d = r->decision;
  int k = r->active_count, contacts = 0, several = 0, apart = 0;
  if (is_mixed(r, r->active, k)) return decide_in_layer(r, letter, known, known_count);
  if (k == 1 && decide_by_rates(r, letter, known, known_count)) return 1;
  for (int i = 0; i < k; i++) contacts |= is_half_line(r, r->active[i]);
  if (k == 1 && !contacts && is_two_fold(r, letter, r->active[0], 0)) {
    finish(r, NON_UNIQUE, TWO_FOLD, r->active[0]);
    return 0;
  }
  r->several_count = 0;
  r->equations.is_raw = 1;
  int has_law = begin_law(r, letter, known, known_count);
  if (has_law) explore(r, d, 0, 0);
  r->equations.is_raw = 0;
  int is_hidden = has_law && has_hidden(r, d), are_many = is_hidden && k > MOST_TRIED;
  if (are_many && follow_step(r, letter, known, known_count)) return 1;
  if (!has_law || (is_hidden && !(are_many && d->motions))) return try_modes(r, letter, known, known_count);
  if (!d->motions || r->status != RUNNING) return no_motion(r, letter);
  for (int i = 0; i < d->motions; i++) {
    int is_new = 1;
    for (int j = 0; j < i; j++) is_new &= !is_same_motion(r, d->motion + i, d->motion + j);
    if (!is_new) continue;
    several++;
    letters_of_motion(r, d, d->motion + i, r->found.letter);
    for (int q = 0; q < r->n; q++) r->rates_of_several[r->several_count * r->n + q] = d->motion[i].series[q * COMPARED];
    r->several[r->several_count++] = mode_number(r->table, r->found.letter);
    apart |= r->several[r->several_count - 1] != r->several[0];
  }
  if (several > 1) { finish(r, NON_UNIQUE, apart ? AMBIGUOUS : SEVERAL_DIRECTIONS, apart ? 0 : several); return 0; }
  choose_motion(r, d, d->motion);
  return r->status == RUNNING;
}
