/* Points of branches of periodic orbits: nonsmooth/orbit/branches/orbit_branches.py ------------------------------------ */

/* Below this part of the step before, steps with the same derivatives are worth their while. */
#define CONTRACTS 0.05

/* The equations of an orbit with its free parameters at the unknowns in ``memory``, with parameters where the memory
 * of the legs begins. Left there: residual, Jacobian, and legs as they were flown. The number of a leg that fails, -1
 * if none does. */
int64_t orbit_evaluate(const Orbit *o, const Demands *d, const double *wrap, double tol, double *memory) {
  Shooting w = shooting_of(o, d, NULL, wrap, memory);
  double left;
  if (!orbit_parameters(&w)) return 0;
  int64_t failed = fly_orbit(&w, tol, &left);
  if (failed < 0) orbit_equations(&w);
  return failed;
}

/* How far the unknowns are from the hyperplane. */
static double off_plane(const Shooting *w, const double *across, double level) {
  double sum = 0;
  for (int64_t i = 0; i < w->wide; i++) sum += across[i] * (w->u[i] / w->scales[i]);
  return sum - level;
}

/* A step with the derivatives that are factored; its norm in units of the unknowns. */
static double bordered_step(Shooting *w, const double *across, double level) {
  double most;
  w->residual[w->size] = off_plane(w, across, level);
  double size = orbit_step(w, 1, &most);
  take_step(w);
  return size;
}

/* Steps with the derivatives of the last full one, whose size is ``last``, until what is left is below the
 * tolerance: 1; 0 where they shrink too little, or where the legs cannot be flown. */
static int chord_converges(Shooting *w, const double *across, double level, double *last) {
  double rate = 0;
  for (int again = 0; again < 4; again++) {
    if (!orbit_parameters(w) || !plain_residual(w, 0)) return 0;
    double size = bordered_step(w, across, level), ratio = size / *last;
    if (!(size <= 1e6)) return 0;
    /* a full step left the square of its size, one with the same derivatives twice as much of its own */
    rate = again ? larger(ratio, rate) : 2 * ratio;
    if (size <= w->d->tol || rate * size <= 0.1 * w->d->tol) return 1;
    if (size <= w->d->noise && ratio >= 0.25) return 1;
    *last = size;
    if (ratio > CONTRACTS) return 0;
  }
  return 0;
}

/* Move the unknowns in ``memory`` across a direction (in units of the unknowns, ``scales``) to the branch: see
 * ``correct`` of nonsmooth/solvers/continuation/curve.py. One parameter is free; parameters are where the memory of the
 * legs begins. Left there as by ``orbit_evaluate``. The number of full steps, or 0. */
int64_t orbit_correct(const Orbit *o, const Demands *d, const double *scales, const double *wrap, const double *across,
                      double *memory) {
  Shooting w = shooting_of(o, d, scales, wrap, memory);
  double level = off_plane(&w, across, 0), last = INFINITY, left;
  for (int64_t iteration = 1; iteration <= d->most; iteration++) {
    if (!orbit_parameters(&w) || fly_orbit(&w, iteration == 1 ? d->coarse : d->finest, &left) >= 0) return 0;
    orbit_equations(&w);
    if (!factor_orbit(&w, across)) return 0;
    double size = bordered_step(&w, across, level);
    if (!(size <= 1e6)) return 0;
    int is_done = iteration > 1 && (size <= d->tol || size * size <= d->tol * last);
    is_done = is_done || (iteration > 1 && size <= d->noise && size >= 0.25 * last);
    last = size;
    if (!is_done && !chord_converges(&w, across, level, &last)) continue;
    if (!orbit_parameters(&w) || !orbit_at(&w)) return 0;
    return iteration;
  }
  return 0;
}

/* The direction (wide) in which equations with a Jacobian (wide - 1, wide) are kept, along ``before``, and the
 * determinant of the Jacobian bordered by it. ``memory`` has room for wide (wide + 2); the direction is left where it
 * begins. 0 where the Jacobian bordered by ``before`` is singular. */
int64_t bordered_direction(const double *jacobian, const double *before, int64_t wide, double *determinant,
                           double *memory) {
  double *b = memory, *a = b + wide, *pivots = a + wide * wide, size = 0, length = 0;
  memcpy(a, jacobian, sizeof(double) * (wide - 1) * wide);
  memcpy(a + (wide - 1) * wide, before, sizeof(double) * wide);
  if (!triangles(a, wide, pivots)) return 0;
  memset(b, 0, sizeof(double) * wide);
  b[wide - 1] = 1;
  solve_triangles(a, wide, pivots, b);
  *determinant = 1;
  for (int64_t k = 0; k < wide; k++) {
    double pivot = a[k * wide + k];
    size += log(fabs(pivot));
    if ((pivot < 0) != ((int64_t)pivots[k] != k)) *determinant = -*determinant;
    length += b[k] * b[k];
  }
  length = sqrt(length);
  for (int64_t k = 0; k < wide; k++) b[k] /= length;
  *determinant *= exp(size) * length;
  return finite_all(b, wide);
}
