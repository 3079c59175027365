/* Periodic orbits by Newton's method: nonsmooth/orbit/periodic/shooting.py -------------------------------------------- */

/* An orbit of a fixed itinerary. Unknowns are the starts of all legs, then their durations, then free parameters. */
typedef struct {
  int64_t n, parameters, moving, free;
  const Legs *legs, *plain;    /* with derivatives, and the states alone */
  const int32_t *own, *row;    /* entries of (x, X, P) that move: places in all matrices, and in the rows of ``legs`` */
  const int32_t *chosen;       /* the free parameters */
  const double *start, *fixed; /* matrices (x, X, P) at the starts, transposed, and of entries that do not move */
  int64_t of_legs, of_plain;   /* sizes of their memory */
} Orbit;

/* What is asked for: see ``converge`` in nonsmooth/solvers/newton.py and ``_polished`` in orbit/periodic/find_periodic.py. Legs
 * advance the last state by ``periods`` times what a program gives of the parameters, with its derivatives. */
typedef struct {
  double tol, noise, finest, coarse, extended, final, rounding, longest, periods;
  const Values *period;
  int64_t most, most_steps;
} Demands;

typedef struct {
  const Orbit *o;
  const Demands *d;
  const double *scales, *wrap;
  double *u, *residual, *matrix, *factors, *step, *sorted, *pivots, *turned, *whole, *rest, *later, *legs, *plain;
  int64_t size, wide; /* equations, and unknowns with the free parameters */
  double advance;
} Shooting;

int64_t orbit_size(void) { return sizeof(Orbit); }
int64_t demands_size(void) { return sizeof(Demands); }

/* Numbers before the memory of the legs: unknowns, residual, Jacobian row by row, then room for work. */
int64_t orbit_work(const Orbit *o) {
  int64_t count = o->legs->count, n = o->n, size = count * (n + 1), wide = size + o->free;
  int64_t vectors = 5 * wide + n * n + count * n * (1 + n + o->free) + count * o->plain->results;
  return vectors + o->free + size * wide + wide * wide;
}

static Shooting shooting_of(const Orbit *o, const Demands *d, const double *scales, const double *wrap, double *memory) {
  int64_t count = o->legs->count, n = o->n, size = count * (n + 1), wide = size + o->free;
  Shooting w = {.o = o, .d = d, .scales = scales, .wrap = wrap, .u = memory, .size = size, .wide = wide};
  w.residual = w.u + wide;
  w.matrix = w.residual + wide;
  w.factors = w.matrix + size * wide;
  w.step = w.factors + wide * wide;
  w.sorted = w.step + wide;
  w.pivots = w.sorted + wide;
  w.turned = w.pivots + wide;
  w.whole = w.turned + n * n;
  w.rest = w.whole + count * n * (1 + n + o->free);
  w.later = w.rest + count * o->plain->results;
  w.legs = w.later + o->free;
  w.plain = w.legs + o->of_legs;
  return w;
}

/* Give the legs the free parameters, and find by how much they advance the last state, with its derivatives; 0
 * where there is no memory. */
static int orbit_parameters(Shooting *w) {
  const Orbit *o = w->o;
  const Values *e = w->d->period;
  for (int64_t j = 0; j < o->free; j++) {
    w->legs[o->chosen[j]] = w->plain[o->chosen[j]] = w->u[w->size + j];
    w->later[j] = 0;
  }
  w->advance = 0;
  if (!e) return 1;
  double *work = calloc(e->size, sizeof(double));
  if (!work) return 0;
  values_prepare(e, w->legs, work);
  values_run(e, w->legs, w->legs, work);
  w->advance = w->d->periods * work[e->output[0]];
  for (int64_t j = 0; j < o->free; j++) w->later[j] = w->d->periods * work[e->output[1 + o->chosen[j]]];
  free(work);
  return 1;
}

/* Fly all legs with their derivatives from the unknowns. The number of one that fails, or -1. */
static int64_t fly_orbit(const Shooting *w, double tol, double *left) {
  const Orbit *o = w->o;
  const Legs *l = o->legs;
  int64_t n = o->n, block = n * (1 + n + o->free);
  double *z = w->legs + l->states;
  memcpy(w->whole, o->start, sizeof(double) * l->count * block);
  for (int64_t i = 0; i < l->count; i++) memcpy(w->whole + i * block, w->u + i * n, sizeof(double) * n);
  for (int64_t k = 0; k < o->moving; k++) z[o->row[k]] = w->whole[o->own[k]];
  memcpy(w->legs + l->durations, w->u + l->count * n, sizeof(double) * l->count);
  int64_t failed = fly_legs(l, w->legs, tol, w->d->most_steps, left);
  if (failed >= 0) return failed;
  memcpy(w->whole, o->fixed, sizeof(double) * l->count * block);
  for (int64_t k = 0; k < o->moving; k++) w->whole[o->own[k]] = z[o->row[k]];
  return -1;
}

/* The gap between the end of leg i, as the symmetry maps it, and the next start; ``rest`` as ``g``, or null. */
static void leg_gap(const Shooting *w, int64_t i, const double *g, const double *rest, double value) {
  int64_t n = w->o->n, count = w->o->legs->count, last = i + 1 == count;
  const double *next = w->u + (last ? 0 : i + 1) * n, *wrap = last ? w->wrap : NULL;
  double *gap = w->residual + i * n;
  for (int64_t k = 0; k < n; k++) {
    double after = wrap ? 0 : g[k], more = rest && !wrap ? rest[k] : 0;
    for (int64_t m = 0; m < n && wrap; m++) {
      after += wrap[k * n + m] * g[m];
      if (rest) more += wrap[k * n + m] * rest[m];
    }
    gap[k] = after - next[k];
    if (last && k == n - 1) gap[k] -= w->advance;
    gap[k] += more;
  }
  w->residual[count * n + i] = value;
}

/* Residual and Jacobian, by the free parameters too, from the legs as they were flown. */
static void orbit_equations(const Shooting *w) {
  const Legs *l = w->o->legs;
  int64_t n = w->o->n, count = l->count, size = w->size, wide = w->wide, q = w->o->parameters, more = w->o->free;
  memset(w->matrix, 0, sizeof(double) * size * wide);
  for (int64_t i = 0; i < count; i++) {
    int64_t next = i + 1 == count ? 0 : i + 1, time = count * n + i;
    const double *x = w->whole + i * n * (1 + n + more) + n, *by_p = x + n * n;
    const double *rate = w->legs + l->after + i * l->width, *g = w->legs + l->events + i * l->results;
    const double *slope = g + n, *direct = slope + n * n, *e = direct + n * q, *mirror = next ? NULL : w->wrap;
    leg_gap(w, i, g, NULL, e[0]);
    if (mirror) {
      for (int64_t k = 0; k < n; k++)
        for (int64_t c = 0; c < n; c++) {
          double sum = 0;
          for (int64_t m = 0; m < n; m++) sum += mirror[k * n + m] * slope[c * n + m];
          w->turned[c * n + k] = sum;
        }
      slope = w->turned;
    }
    for (int64_t k = 0; k < n; k++) {
      double *row = w->matrix + (i * n + k) * wide;
      for (int64_t m = 0; m < n; m++) {
        double by = slope[m * n + k];
        if (by == 0) continue;
        for (int64_t c = 0; c < n; c++) row[i * n + c] += by * x[c * n + m];
        for (int64_t j = 0; j < more; j++) row[size + j] += by * by_p[j * n + m];
        row[time] += by * rate[m];
      }
      for (int64_t j = 0; j < more; j++) {
        const double *own = direct + w->o->chosen[j] * n;
        double sum = mirror ? 0 : own[k];
        for (int64_t m = 0; m < n && mirror; m++) sum += mirror[k * n + m] * own[m];
        row[size + j] += !next && k == n - 1 ? sum - w->later[j] : sum;
      }
      row[next * n + k] -= 1;
    }
    double *row = w->matrix + time * wide;
    for (int64_t m = 0; m < n; m++) {
      for (int64_t c = 0; c < n; c++) row[i * n + c] += e[1 + m] * x[c * n + m];
      for (int64_t j = 0; j < more; j++) row[size + j] += e[1 + m] * by_p[j * n + m];
      row[time] += e[1 + m] * rate[m];
    }
    for (int64_t j = 0; j < more; j++) row[size + j] += e[1 + n + w->o->chosen[j]];
  }
}

/* Unknown i where those of each leg are together; those of no leg follow. */
static int64_t leg_order(const Shooting *w, int64_t i) {
  int64_t n = w->o->n, leg = i / (n + 1), k = i % (n + 1);
  return i >= w->size ? i : k < n ? leg * n + k : w->o->legs->count * n + leg;
}

/* Triangles of a matrix (size, size) in its place, rows exchanged whole; 0 where it is singular. Zeros are skipped. */
static int triangles(double *a, int64_t size, double *pivots) {
  for (int64_t k = 0; k < size; k++) {
    int64_t best = k;
    for (int64_t i = k + 1; i < size; i++) if (fabs(a[i * size + k]) > fabs(a[best * size + k])) best = i;
    if (!(fabs(a[best * size + k]) > 0)) return 0;
    pivots[k] = best;
    for (int64_t j = 0; j < size && best != k; j++) {
      double t = a[k * size + j]; a[k * size + j] = a[best * size + j]; a[best * size + j] = t;
    }
    for (int64_t i = k + 1; i < size; i++) {
      if (a[i * size + k] == 0) continue;
      double f = a[i * size + k] /= a[k * size + k];
      for (int64_t j = k + 1; j < size; j++) a[i * size + j] -= f * a[k * size + j];
    }
  }
  return 1;
}

/* Solve for b in its place. */
static void solve_triangles(const double *a, int64_t size, const double *pivots, double *b) {
  for (int64_t k = 0; k < size; k++) { /* rows were exchanged whole, with what was left of them */
    int64_t best = pivots[k];
    double t = b[k]; b[k] = b[best]; b[best] = t;
  }
  for (int64_t k = 0; k < size; k++)
    for (int64_t i = k + 1; i < size; i++) if (a[i * size + k] != 0) b[i] -= a[i * size + k] * b[k];
  for (int64_t k = size - 1; k >= 0; k--) {
    for (int64_t j = k + 1; j < size; j++) b[k] -= a[k * size + j] * b[j];
    b[k] /= a[k * size + k];
  }
}

/* The Jacobian as triangles, leg after leg, so that few entries fill; 0 where it is singular. With ``across``, a row,
 * it is bordered by that and columns are in units of the unknowns. */
static int factor_orbit(const Shooting *w, const double *across) {
  int64_t wide = across ? w->wide : w->size;
  double *a = w->factors;
  for (int64_t i = 0; i < wide; i++) {
    const double *row = i < w->size ? w->matrix + leg_order(w, i) * w->wide : across;
    for (int64_t j = 0; j < wide; j++) {
      int64_t own = leg_order(w, j);
      a[i * wide + j] = i < w->size && across ? row[own] * w->scales[own] : row[own];
    }
  }
  return triangles(a, wide, w->pivots);
}

/* Newton's step for the residual; its norm in units of the unknowns, and its largest entry in ``most``. */
static double orbit_step(const Shooting *w, int is_bordered, double *most) {
  int64_t wide = is_bordered ? w->wide : w->size;
  double *b = w->sorted, sum = 0;
  for (int64_t i = 0; i < wide; i++) b[i] = -w->residual[leg_order(w, i)];
  solve_triangles(w->factors, wide, w->pivots, b);
  *most = 0;
  for (int64_t i = 0; i < wide; i++) {
    int64_t own = leg_order(w, i);
    double part = is_bordered ? fabs(b[i]) : fabs(b[i]) / w->scales[own];
    w->step[own] = is_bordered ? b[i] * w->scales[own] : b[i];
    sum += part * part;
    *most = part > *most || part != part ? part : *most;
  }
  return sqrt(sum);
}

static void take_step(const Shooting *w) {
  for (int64_t i = 0; i < w->wide; i++) w->u[i] += w->step[i];
}

/* Residual without derivatives, in extended precision if asked for; 0 where there is none. */
static int plain_residual(const Shooting *w, int is_exact) {
  const Legs *l = w->o->plain;
  int64_t n = w->o->n;
  double left, *a = w->plain;
  for (int64_t i = 0; i < l->count; i++) memcpy(a + l->states + i * l->width, w->u + i * n, sizeof(double) * n);
  memcpy(a + l->durations, w->u + l->count * n, sizeof(double) * l->count);
  int64_t failed = is_exact ? fly_legs_extended(l, a, w->d->extended, w->d->most_steps, &left, w->rest)
                            : fly_legs(l, a, w->d->finest, w->d->most_steps, &left);
  if (failed >= 0) return 0;
  for (int64_t i = 0; i < l->count; i++) {
    const double *g = a + l->events + i * l->results;
    leg_gap(w, i, g, is_exact ? w->rest + i * l->results : NULL, g[n]);
  }
  return 1;
}

/* Full steps until the next one would be below the tolerance; 0 where they do not converge. Where the step after
 * the next is below rounding even with derivatives from here, the next needs none of its own. */
static int64_t orbit_converges(const Shooting *w) {
  const Demands *d = w->d;
  int64_t count = w->o->legs->count;
  double last = INFINITY, size, most = 0.1, left;
  for (int64_t iteration = 1; iteration <= d->most; iteration++) {
    double longest = 0, least = 0;
    for (int64_t i = w->size - count; i < w->size; i++) {
      longest = larger(w->u[i], longest);
      least = smaller(w->u[i], least);
    }
    if (!(larger(-least, longest) <= d->longest)) return 0;
    /* after a step of this size the next one is its square, and what it leaves its fourth power */
    if (fly_orbit(w, smaller(larger(0.1 * pow(most, 4), d->finest), d->coarse), &left) >= 0) return 0;
    orbit_equations(w);
    if (!factor_orbit(w, NULL)) return 0;
    size = orbit_step(w, 0, &most);
    if (!(size <= 1e6)) return 0;
    take_step(w);
    if (size <= d->tol || (size <= d->noise && size >= 0.25 * last)) return iteration;
    if (iteration > 1 && size * size <= d->tol * last) return iteration;
    double shrinks = 2 * size * size / (last * last); /* of steps with these derivatives */
    if (shrinks > 0 && shrinks * size * size * size <= 0.1 * d->final * last * last && plain_residual(w, 0)) {
      size = orbit_step(w, 0, &most);
      if (!(size <= 1e6)) return 0;
      take_step(w);
      if (size * shrinks <= 0.1 * d->final) return iteration + 1;
    }
    last = size;
  }
  return 0;
}

static double largest_residual(const Shooting *w) {
  double most = 0;
  for (int64_t i = 0; i < w->size; i++) most = larger(fabs(w->residual[i]), most);
  return most;
}

static int orbit_at(const Shooting *w) {
  double left;
  if (fly_orbit(w, w->d->finest, &left) >= 0) return 0;
  orbit_equations(w);
  return 1;
}

/* Solve the equations of an orbit from the unknowns in ``memory``, with parameters where the memory of the legs
 * begins. Left there: unknowns, residual, Jacobian, and legs as they were flown. The number of steps, or 0. */
int64_t orbit_newton(const Orbit *o, const Demands *d, const double *scales, const double *wrap, double *memory) {
  Shooting w = shooting_of(o, d, scales, wrap, memory);
  int64_t steps = orbit_parameters(&w) ? orbit_converges(&w) : 0;
  double most;
  if (!steps || !orbit_at(&w)) return 0;
  for (int again = 0; again < 2; again++) { /* to rounding */
    double before = largest_residual(&w);
    int is_exact = plain_residual(&w, 1);
    if (!is_exact) orbit_equations(&w);
    if (!factor_orbit(&w, NULL)) return 0;
    orbit_step(&w, 0, &most);
    if (is_exact && most <= d->final) { /* the derivatives are those of the orbit */
      for (int64_t i = 0; i < w.size; i++) { /* rounding of the unknowns is what remains */
        double there = w.u[i] + w.step[i];
        w.step[i] = there - w.u[i];
        w.u[i] = there;
      }
      for (int64_t i = 0; i < w.size; i++)
        for (int64_t j = 0; j < w.size; j++) w.residual[i] += w.matrix[i * w.size + j] * w.step[j];
      return steps;
    }
    if (most <= d->rounding) break;
    take_step(&w);
    if (orbit_at(&w) && largest_residual(&w) < before) { steps++; continue; }
    for (int64_t i = 0; i < w.size; i++) w.u[i] -= w.step[i];
    return orbit_at(&w) ? steps : 0;
  }
  orbit_equations(&w); /* the residual as flown */
  return steps;
}
