/* Sets of codimension two and more. Their switching functions are adjacent; each has the letter of its set: 0 on it, OFF,
 * LEAVING in the first step off it, then LEFT_BEHIND while h is integrated. */

static double length_of(const double *h, int k) {
  double most = 0, sum = 0;
  for (int i = 0; i < k; i++) most = larger(fabs(h[i]), most);
  for (int i = 0; i < k; i++) sum += most > 0 ? (h[i] / most) * (h[i] / most) : fabs(h[i]);
  return most > 0 ? most * sqrt(sum) : sum;
}

/* Rounding in the functions of a set, times epsilon. */
static double scale_of_set(const Run *r, int f, const double *scales_of) {
  double scale = 0;
  for (int i = f; i < f + size_of(r, f); i++) scale = larger(scales_of[i], scale);
  return scale;
}

static double unit_of(const double *h, int k, double *u) {
  double r = length_of(h, k);
  for (int i = 0; i < k; i++) u[i] = h[i] / r;
  return r;
}

/* Set the multipliers of the sets at a state; ``unknowns`` are h of sets left behind and directions of sets being left. */
static void aim(Run *r, const int8_t *letter, const double *x, const double *unknowns) {
  const double *h = 0;
  combine_rows(r, letter, x);
  EACH_SET(r, f) {
    int k = size_of(r, f);
    double *u = r->direction + f;
    for (int i = f; i < f + k; i++) r->moving[i] = letter[f] > 1 && letter[f] != IDLE;
    if (letter[f] < OFF || letter[f] == IDLE) { for (int i = 0; i < k; i++) u[i] = 0; continue; }
    if (letter[f] != OFF) { unit_of(unknowns + f, k, u); continue; }
    if (!h) {
      values_at(&r->s->surfaces, x, r->p, r->heights);
      h = r->heights_of;
      for (int i = 0; i < r->m; i++) r->heights_of[i] = out_of(&r->s->surfaces, r->heights, i);
    }
    unit_of(h + f, k, u);
  }
}

/* Set the multipliers at the start of an expansion. */
static void aim_again(Run *r, const Expansion *e) {
  combine_rows(r, e->l.letter, r->x);
  for (int i = 0; r->s->sets && i < r->m; i++) {
    r->moving[i] = e->l.letter[i] > 1 && e->l.letter[i] != IDLE;
    r->direction[i] = set_of(r, i) < 0 ? 0 : e->lambda[(int64_t)i * r->stride];
  }
}

/* Series ------------------------------------------------------------------------------------------- */

/* Coefficient k of h/|h| from that of h, both in units of |h| at the start. */
static void push_direction(Run *r, Expansion *e, int f, int k, const double *h, int apart) {
  int size = size_of(r, f), stride = r->stride;
  double *root = e->root + (int64_t)f * stride, square = 0, curved = 0;
  if (k == 0) {
    double first[3];
    for (int i = 0; i < size; i++) first[i] = h[(int64_t)i * apart];
    e->radius[f] = length_of(first, size);
    e->per_radius[f] = 1 / e->radius[f];
  }
  for (int i = 0; i < size; i++) {
    double *own = e->apart + (int64_t)(f + i) * stride;
    own[k] = h[(int64_t)i * apart] * e->per_radius[f];
    square += own[0] * own[k];
    if (k > 1) curved += convolve(own, own, k, 1, k - 1);
  }
  /* Along a straight line ``curved`` is that of the root, exactly so along an axis. */
  root[k] = k > 1 ? square + 0.5 * (curved - convolve(root, root, k, 1, k - 1)) : k ? square : 1;
  for (int i = 0; i < size; i++) {
    double *u = e->lambda + (int64_t)(f + i) * stride;
    u[k] = e->apart[(int64_t)(f + i) * stride + k] - convolve(u, root, k, 0, k - 1);
  }
}

/* Coefficients k of the multipliers of sets that the mode is off. */
static void follow_sets(Run *r, Expansion *e, int k) {
  int stride = r->stride;
  EACH_SET(r, f) {
    int size = size_of(r, f), letter = e->l.letter[f];
    if (letter == LEFT_BEHIND) push_direction(r, e, f, k, e->series + (int64_t)f * stride + k, stride);
    else if (letter == OFF) {
      double h[3];
      for (int i = 0; i < size; i++) h[i] = row_of(r, r->n + r->width + f + i)[k];
      push_direction(r, e, f, k, h, 1);
    }
  }
}

/* Rates at which sets are left, along their directions; zero where later orders decided. */
static void leave_at_rates(Run *r, Expansion *e) {
  int w = r->width, stride = r->stride;
  EACH_LEAVING(r, e, f) {
    int size = size_of(r, f);
    double *radius = e->rates + (int64_t)f * (stride + 1), rate = 0, terms = 0;
    for (int i = 0; i < size; i++) {
      double u = e->lambda[(int64_t)(f + i) * stride], g = row_of(r, r->n + f + i)[0], sum = fabs(g);
      for (int j = f; j < f + size; j++) sum += fabs(e->slopes[(f + i) * w + j]);
      rate += u * g;
      terms += fabs(u) * sum;
    }
    int known = 0;
    for (int row = 0; row < e->l.atoms && e->l.mode == r->now.mode; row++)
      if (e->l.kind[row] == NEAR_GUARD && e->l.index[row] == f) known = r->drop[row];
    radius[0] = 0;
    radius[1] = known <= 1 && fabs(rate) > VANISHES * terms ? rate : 0;
    e->radius[f] = 0;
  }
}

/* The matrix r->work of coefficients k of sliding multipliers and leaving directions, listed as r->pending, and of
 * coefficients k + 1 of the distances; its rows. ``count``: without the distances. */
static int leaving_matrix(Run *r, const Expansion *e, int k, int *count) {
  int slides = e->l.slides, n = 0, sets = 0, stride = r->stride, w = r->width, at = slides;
  int32_t *which = r->pending;
  for (int i = 0; i < slides; i++) which[n++] = e->l.sliding[i];
  EACH_LEAVING(r, e, f) {
    for (int i = f; i < f + size_of(r, f); i++) which[n++] = i;
    sets++;
  }
  int all = n + sets, column = n;
  double *a = r->work;
  memset(a, 0, sizeof(double) * all * all);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) a[i * all + j] = e->slopes[which[i] * w + which[j]];
  EACH_LEAVING(r, e, f) {
    int size = size_of(r, f);
    for (int i = f; i < f + size; i++, at++) {
      double u = e->lambda[(int64_t)i * stride];
      a[at * all + at] -= (k + 1) * e->rates[(int64_t)f * (stride + 1) + 1];
      a[at * all + column] = -(k + 1) * u;
      a[column * all + at] = u;
    }
    column++;
  }
  *count = n;
  return all;
}

/* Solve it in place of b; undetermined unknowns are small, except reactions of joints. */
static void leaving_rates(Run *r, const Expansion *e, double *a, int all, double *b) {
  double *inverse = r->decision->work, *size = inverse + (int64_t)all * all, *rest = size + all;
  int is_solved;
  if (r->s->joints || r->c) {
    for (int i = 0; i < all; i++) size[i] = i < e->l.slides && has_law(r, e->l.sliding[i], JOINT_LAW) ? 1 / MERGED : 1;
    is_solved = invert_any(a, all, size, inverse, rest, r->decision->pivot);
    apply(inverse, b, all, rest);
    memcpy(b, rest, sizeof(double) * all);
  } else is_solved = solve(a, b, all);
  if (!is_solved) for (int i = 0; i < all; i++) b[i] = NAN;
}

/* Where joints restrict the slip of a set that is left at rate zero, rows of order k, with residual ``b``, determine
 * coefficients k - 1 across its direction and of sliding multipliers. Whether these changed. */
static int turn_leaving(Run *r, Expansion *e, int k, const double *a, int all, const double *b) {
  double *z = r->decision->work, *y = z + (int64_t)all * all, *turned = y + (int64_t)all * all, *rest = turned + (int64_t)all * all;
  int stride = r->stride, slides = e->l.slides, at = slides, changes = 0, count = null_space(a, all, all, z, rest, r->decision->pivot);
  for (int i = 0; count && i < all; i++) for (int j = 0; j < all; j++) turned[i * all + j] = a[j * all + i];
  if (!count || null_space(turned, all, all, y, rest, r->decision->pivot) != count) return 0;
  double *d = turned, *change = d + (int64_t)count * count;
  memset(d, 0, sizeof(double) * count * count);
  for (int l = 0; l < count; l++) {
    double *own = y + (int64_t)l * all, terms = 0;
    change[l] = -dot(own, b, all);
    for (int i = 0; i < all; i++) terms += fabs(own[i] * b[i]);
    if (fabs(change[l]) <= VANISHES * terms) change[l] = 0;
    changes |= change[l] != 0;
  }
  EACH_LEAVING(r, e, f)
    for (int end = at + size_of(r, f); at < end; at++)
      for (int l = 0; l < count * count; l++)
        d[l] += (k + 1) * e->rates[(int64_t)f * (stride + 1) + 2] * y[l / count * all + at] * z[l % count * all + at];
  if (!changes || !solve_any(d, change, count, INFINITY, rest, r->decision->pivot)) return 0;
  for (int i = 0; i < at; i++) {
    double *to = (i < slides ? e->series : e->lambda) + (int64_t)r->pending[i] * stride + k - 1;
    for (int l = 0; l < count; l++) *to += change[l] * z[l * all + i];
  }
  return 1;
}

/* Coefficients k of leaving directions and k + 1 of the distances, with those of sliding multipliers; 1 where earlier ones
 * changed. */
static int leave_sets(Run *r, Expansion *e, int k, int may_turn) {
  if (k == 0) { leave_at_rates(r, e); return 0; }
  int slides = e->l.slides, stride = r->stride, n, all = leaving_matrix(r, e, k, &n), at = slides, column = n;
  const int32_t *which = r->pending;
  double *a = r->work, *b = a + (int64_t)all * all;
  for (int i = 0; i < n; i++) b[i] = -row_of(r, r->n + which[i])[k];
  EACH_LEAVING(r, e, f) {
    int size = size_of(r, f);
    const double *radius = e->rates + (int64_t)f * (stride + 1);
    b[column] = 0;
    for (int i = f; i < f + size; i++, at++) {
      const double *u = e->lambda + (int64_t)i * stride;
      double sum = 0;
      for (int j = 1; j < k; j++) sum += u[j] * radius[k + 1 - j];
      b[at] += (k + 1) * sum;
      b[column] -= 0.5 * (k > 1 ? convolve(u, u, k, 1, k - 1) : 0);
    }
    column++;
  }
  if ((r->s->joints || r->c) && may_turn && k > 1 && turn_leaving(r, e, k, a, all, b)) return 1;
  leaving_rates(r, e, a, all, b);
  for (int i = 0; i < slides; i++) e->series[(int64_t)which[i] * stride + k] = b[i];
  for (int i = slides; i < n; i++) e->lambda[(int64_t)which[i] * stride + k] = b[i];
  at = n;
  EACH_LEAVING(r, e, s) e->rates[(int64_t)s * (stride + 1) + k + 1] = b[at++];
  return 0;
}

/* Coefficients k + 1 of the integrated h. */
static void close_sets(Run *r, Expansion *e, int k) {
  int stride = r->stride;
  EACH_SET(r, f) {
    if (k == r->order) break;
    int letter = e->l.letter[f];
    if (letter != LEFT_BEHIND && letter != LEAVING) continue;
    for (int i = f; i < f + size_of(r, f); i++) {
      double *h = e->series + (int64_t)i * stride;
      if (letter == LEFT_BEHIND) { h[k + 1] = row_of(r, r->n + i)[k] / (k + 1); continue; }
      const double *radius = e->rates + (int64_t)f * (stride + 1), *u = e->lambda + (int64_t)i * stride;
      double sum = 0;
      for (int j = 0; j <= k; j++) sum += u[j] * radius[k + 1 - j];
      h[k + 1] = sum;
    }
  }
}

/* Begin the expansion of a mode: multipliers of sets, integrated h, derivatives of the rates by the multipliers. */
static void begin_sets(Run *r, Expansion *e, const double *unknowns) {
  int w = r->width, leaving = 0;
  memset(e->lambda, 0, sizeof(double) * w * r->stride); /* the first guess of each order is zero */
  for (int i = 0; i < r->m; i++) {
    e->lambda[(int64_t)i * r->stride] = r->direction[i];
    if (e->l.letter[i] == LEFT_BEHIND) e->series[(int64_t)i * r->stride] = unknowns[i];
    leaving |= e->l.letter[i] == LEAVING;
  }
  for (int i = 0; i < w && leaving; i++)
    for (int j = 0; j < w; j++)
      e->slopes[i * w + j] = r->slope[i * w + j] * (j < r->m && e->l.letter[j] == LEAVING ? factor_of(r, j) : 1);
}

/* Guards: NEAR, how far |h| (or on a set friction's limit) has fallen; SLIP, how far friction can rise. */
static void guard_of_set(Run *r, const Layout *l, int row, const double *series, int count, double *g) {
  int i = l->index[row], size = size_of(r, i), stride = r->stride, letter = l->letter[i];
  const double *factor = row_of(r, r->n + 2 * r->width + i), *radius = r->expansion->radius;
  if (letter == LEAVING) {
    if (count > 1) memcpy(g, r->expansion->rates + (int64_t)i * (stride + 1), sizeof(double) * count);
    else {
      double h[3];
      for (int j = 0; j < size; j++) h[j] = series[(int64_t)(i + j) * stride];
      g[0] = length_of(h, size);
    }
    return;
  }
  double per = radius[i] > 0 ? 1 / radius[i] : 0;
  for (int k = 0; k < count; k++) {
    double sum = 0;
    if (l->kind[row] == SLIP_GUARD) {
      sum = convolve(factor, factor, k, 0, k);
      for (int j = i; j < i + size; j++) {
        const double *nu = series + (int64_t)j * stride;
        sum -= convolve(nu, nu, k, 0, k);
      }
    } else if (letter == 0) {
      sum = per > 0 ? convolve(factor, factor, k, 0, k) * per * per : 0;
      if (k == 0) sum = per > 0 ? sum - LIMIT_FALL * LIMIT_FALL : 1;
    } else {
      for (int j = i; j < i + size; j++) {
        const double *h = letter == OFF ? row_of(r, r->n + r->width + j) : series + (int64_t)j * stride;
        if (k == 0) sum += (h[0] * per) * (h[0] * per);
        else sum += convolve(h, h, k, 0, k) * per * per;
      }
      if (k == 0) sum -= FALL * FALL;
    }
    g[k] = sum;
  }
}

/* Error scales of these guards, from those of switching functions, multipliers and factors. */
static double rounding_of_set(Run *r, const Expansion *e, int row, const Sums *of) {
  int i = e->l.index[row], size = size_of(r, i), letter = e->l.letter[i];
  double sum = 0, radius = e->radius[i];
  for (int j = i; j < i + size; j++) sum += of->height[j];
  if (letter == LEAVING) return sum;
  if (letter != 0) return radius > 0 ? 2 * sum / radius : INFINITY;
  double n = fabs(factor_of(r, i));
  if (e->l.kind[row] == NEAR_GUARD) return n > 0 ? 2 * of->factor[i] / n : INFINITY;
  sum = 0;
  for (int j = i; j < i + size; j++) sum += (fabs(e->series[(int64_t)j * r->stride]) + n) * of->layer[j];
  return 2 * sum;
}

/* Guards of a set in a mode. */
static void lay_out_set(const Run *r, Layout *l, int i) {
  if (l->letter[i] == IDLE) return;
  add_row(l, l->letter[i] ? NEAR_GUARD : SLIP_GUARD, i, 0);
  if (l->letter[i] == 0 && is_scaled(r, i)) add_row(l, NEAR_GUARD, i, 0);
}

static int8_t side_of_set(const Run *r, int i, double h) {
  (void)h;
  return r->idle[set_of(r, i)] ? IDLE : OFF;
}

/* Largest coefficients, in units of the tolerance, of quantities with a relative tolerance. */
static void direction_bounds(const Run *r, const Expansion *e, double *last, double *before) {
  int order = r->order, stride = r->stride;
  double per = 1 / (SAFETY * r->o.rtol);
  for (int i = 0; i < r->m; i++) {
    int letter = e->l.letter[i];
    if (letter != LEFT_BEHIND && letter != LEAVING) continue;
    const double *u = e->lambda + (int64_t)i * stride, *h = e->apart + (int64_t)i * stride;
    *last = larger(fabs(u[order]) * per, *last);
    *before = larger(fabs(u[order - 1]) * per, *before);
    if (letter == LEAVING) continue;
    *last = larger(fabs(h[order]) * per, *last);
    *before = larger(fabs(h[order - 1]) * per, *before);
  }
}

/* Time at which |nu| = |n|, from that at which their squares are equal to rounding. */
static double slip_root(const Run *r, const Expansion *e, int row, double dt, double h) {
  int i = e->l.index[row], size = size_of(r, i), order = r->order;
  double root = dt;
  for (int again = 0; again < 3; again++) {
    double nu[3], rate[3], of_n, n = horner(row_of(r, r->n + 2 * r->width + i), order, root, &of_n), along = 0;
    for (int j = 0; j < size; j++) nu[j] = horner(e->series + (int64_t)(i + j) * r->stride, order, root, &rate[j]);
    double length = length_of(nu, size);
    if (!(length > 0) || n == 0) return dt;
    for (int j = 0; j < size; j++) along += nu[j] * rate[j];
    double slope = ns_sign(n) * of_n - along / length;
    if (!(slope < 0)) return dt;
    root = smaller(larger(root - (fabs(n) - length) / slope, 0), h);
  }
  return fabs(root - dt) <= SLIP_ROOT * h ? root : dt;
}

/* Friction's limit at the start of a step on a set. */
static void measure_limits(Run *r, Expansion *e) {
  EACH_SET(r, f) {
    if (e->l.letter[f] == 0) e->radius[f] = fabs(row_of(r, r->n + 2 * r->width + f)[0]);
  }
}

/* Keep h of sets left behind among the unknowns of a mode. */
static void keep_carried(const Run *r, const int8_t *letter, double *unknowns) {
  for (int i = 0; i < r->width; i++) unknowns[i] = i < r->m && letter[i] == LEFT_BEHIND ? r->unknowns[i] : 0;
}
