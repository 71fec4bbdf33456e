// Sums and matrices of radial functions on a graphics card, as rbf/compiled.py has them.
//
// Defined by options: KIND, the kernel's code; ROWS, the features of a node (3 or 4); PERIODIC;
// SHAPE, of the multiquadrics; COEFFICIENTS, of (1 - cos g) / g^2; TILE, threads of a block.
// A thread has a target, and a block loads control nodes into shared memory, TILE at a time.

typedef long long Count;

__device__ static inline double one_minus_cos(double g)
{
    const double k[] = {COEFFICIENTS};
    const double t = g * g;
    double p = k[8];
#pragma unroll
    for (int i = 7; i >= 0; --i)
        p = p * t + k[i];
    return t * p;
}

__device__ static inline double xi(double x0, double x1, double x2, double x3, double c0, double c1,
                                   double c2, double c3, double period_over_pi, double scale)
{
    const double d0 = x0 - c0;
    const double d3 = x3 - c3;
    if (PERIODIC) {
        const double g = period_over_pi * (x1 * c2 - x2 * c1);
        return sqrt(d0 * d0 + 2.0 * x0 * c0 * one_minus_cos(g) + d3 * d3) * scale;
    }
    const double d1 = x1 - c1;
    const double d2 = x2 - c2;
    double total = d0 * d0 + d1 * d1 + d2 * d2;
    if (ROWS == 4)
        total += d3 * d3;
    return sqrt(total) * scale;
}

__device__ static inline double power(double u, int n)
{
    double p = 1.0;
#pragma unroll
    for (int i = 0; i < n; ++i)
        p *= u;
    return p;
}

__device__ static inline double phi(double q)
{
    const double u = fmax(1.0 - q, 0.0);
    if (KIND == 0)
        return power(u, 4) * (4.0 * q + 1.0);
    if (KIND == 1)
        return u * u;
    if (KIND == 2)
        return power(u, 6) * ((35.0 / 3.0 * q + 6.0) * q + 1.0);
    if (KIND == 3)
        return power(u, 8) * (((32.0 * q + 25.0) * q + 8.0) * q + 1.0);
    if (KIND == 4)
        return power(u, 5);
    if (KIND <= 7) {
        if (q >= 1.0)
            return 0.0;
        const double x = fmax(q, 1e-300);
        const double a = x * x;
        const double b = a * x;
        if (KIND == 5)
            return 1.0 + 80.0 / 3.0 * a - 40.0 * b + 15.0 * a * a - 8.0 / 3.0 * a * b
                   + 20.0 * a * log(x);
        if (KIND == 6)
            return 1.0 - 30.0 * a - 10.0 * b + 45.0 * a * a - 6.0 * a * b - 60.0 * b * log(x);
        return 1.0 - 20.0 * a + 80.0 * b - 45.0 * a * a - 16.0 * a * b + 60.0 * a * a * log(x);
    }
    if (KIND == 8)
        return q * q * log(fmax(q, 1e-300));
    if (KIND == 9)
        return sqrt(SHAPE * SHAPE + q * q);
    if (KIND == 10)
        return SHAPE / sqrt(SHAPE * SHAPE + q * q);
    if (KIND == 11)
        return 1.0 + q * q;
    if (KIND == 12)
        return 1.0 / (1.0 + q * q);
    return exp(-q * q);
}

// out (3, count): sums at targets x (ROWS, count), of controls c (ROWS, n) with weights w (components = 3, n).
extern "C" __global__ void add_up(const double *x, const double *c, const double *w, Count count,
                                  Count n, Count components, double period_over_pi, double scale,
                                  double *out)
{
    __shared__ double tile[ROWS + 3][TILE];
    const int thread = threadIdx.x;
    const Count target = (Count)blockIdx.x * TILE + thread;
    const Count i = target < count ? target : count - 1;
    const double x0 = x[i];
    const double x1 = x[count + i];
    const double x2 = x[2 * count + i];
    const double x3 = x[(ROWS - 1) * count + i];
    double s0 = 0.0;
    double s1 = 0.0;
    double s2 = 0.0;
    for (Count start = 0; start < n; start += TILE) {
        const Count j = start + thread;
        if (j < n) {
            for (int row = 0; row < ROWS; ++row)
                tile[row][thread] = c[row * n + j];
            for (int row = 0; row < 3; ++row)
                tile[ROWS + row][thread] = w[row * n + j];
        }
        __syncthreads();
        const int many = n - start < TILE ? (int)(n - start) : TILE;
        for (int k = 0; k < many; ++k) {
            const double p = phi(xi(x0, x1, x2, x3, tile[0][k], tile[1][k], tile[2][k],
                                    tile[ROWS - 1][k], period_over_pi, scale));
            s0 += tile[ROWS][k] * p;
            s1 += tile[ROWS + 1][k] * p;
            s2 += tile[ROWS + 2][k] * p;
        }
        __syncthreads();
    }
    if (target < count) {
        out[target] = s0;
        out[count + target] = s1;
        out[2 * count + target] = s2;
    }
}

// out (count, n): functions of x (ROWS, count) and c (ROWS, n), times the scalar products of
// directions across (d, count) and along (d, n) if d is not 0. A thread has an entry.
extern "C" __global__ void fill_matrix(const double *x, const double *c, const double *across,
                                       const double *along, Count count, Count n, Count d,
                                       double period_over_pi, double scale, double *out)
{
    const Count entry = (Count)blockIdx.x * TILE + threadIdx.x;
    if (entry >= count * n)
        return;
    const Count a = entry / n;
    const Count b = entry % n;
    double value = phi(xi(x[a], x[count + a], x[2 * count + a], x[(ROWS - 1) * count + a], c[b],
                          c[n + b], c[2 * n + b], c[(ROWS - 1) * n + b], period_over_pi, scale));
    if (d > 0) {
        double dot = 0.0;
        for (Count k = 0; k < d; ++k)
            dot += across[k * count + a] * along[k * n + b];
        value *= dot;
    }
    out[entry] = value;
}
