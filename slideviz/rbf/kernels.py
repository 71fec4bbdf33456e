"""The fourteen radial functions of thesis Tables 2.1 and 2.2 (De Boer et al. 2007).

Every function takes xi = distance / R, and the compiled loops have its formula
(`slideviz.rbf.compiled`), in the order of `slideviz.terms.KERNELS`:

    CP C2, C0       (1 - xi)^4 (4 xi + 1), (1 - xi)^2
    CP C4           (1 - xi)^6 (35/3 xi^2 + 6 xi + 1)
    CP C6           (1 - xi)^8 (32 xi^3 + 25 xi^2 + 8 xi + 1)
    CTPS C0         (1 - xi)^5
    CTPS C1         1 + 80/3 xi^2 - 40 xi^3 + 15 xi^4 - 8/3 xi^5 + 20 xi^2 log xi
    CTPS C2a        1 - 30 xi^2 - 10 xi^3 + 45 xi^4 - 6 xi^5 - 60 xi^3 log xi
    CTPS C2b        1 - 20 xi^2 + 80 xi^3 - 45 xi^4 - 16 xi^5 + 60 xi^4 log xi
    thin plate      xi^2 log xi
    multiquadrics   sqrt(a^2 + xi^2), a / sqrt(a^2 + xi^2)
    quadrics        1 + xi^2, 1 / (1 + xi^2)
    Gaussian        exp(-xi^2)

Those with compact support (CP, CTPS) are 0 from xi = 1 on. Three of the global ones are only
conditionally positive definite and bring a linear polynomial along. The thesis prints 36/3 in CP
C4; it is 35/3, without which the function has a jump in its second derivative. ``a`` of the
(inverse) multiquadric is ``SHAPE``; the inverse one is multiplied by a, which changes no
interpolant, so that it is 1 at 0 like the others.
"""

SHAPE = 0.05  # the parameter a of the multiquadrics, in parts of R
PLAIN = "wendland-c2"  # the default kernel
