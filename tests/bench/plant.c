/* The compliant plant of afm_model/afm_model/plant/compliant.py in C, operation for operation: the floor of `make bench`.

   State, constants and equations have the names and the order of afm_model/plant/state.py and plant/constants.py. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { X, V_X, Y, V_Y, Z, V_Z, Q, V_Q, CONTACT, N, F_X, F_Y, F_MAX };

typedef struct {
    double h, eta_x, eta_y, eta_z, eta_c, xi_x, xi_y, xi_z, xi_c, mu, w, a, r, L_s, delta_0, f_s, zeta_n;
    double gain_x, gain_y, gain_z, x0, z0, lateral_speed, vertical_speed, lateral_force, normal_force, treatment;
    double spring_x, spring_y, spring_z, spring_c, keep_x, keep_y, keep_z, keep_c, take_x, take_y, take_z, take_c;
    double inverse_h, inverse_mu, inverse_L_s, inverse_delta_0;
} Constants;

typedef struct {
    double beta, k_x, k_y;
} Sample;

typedef struct {
    double height, slope_x, slope_y, curvature, curvature_xx, curvature_yy, curvature_xy, strength;
} Surface;

/* (1/6)^(1/3) and its indentation, to the last bit as Python computes them. */
#define U_FIXED_GRIPS 0.5503212081491045
#define INDENTATION_FIXED_GRIPS (-0.27516060407455223)
#define SCALE 10.902723556992838
/* 4^(2/3) */
#define AREA 2.519842099789746

static double larger(double a, double b) { return b > a ? b : a; }

/* contact/jkr.py */

static int64_t bits(double x)
{
    int64_t i;
    memcpy(&i, &x, sizeof i);
    return i;
}

static double from_bits(int64_t i)
{
    double x;
    memcpy(&x, &i, sizeof x);
    return x;
}

/* inverse_cbrt and sincos of afm_model/core/elementary.py, operation by operation. */
static double inverse_cube_root(double x)
{
    double y = from_bits(0x553EF0FF289DD796 - (bits(x) >> 22) * 1398101);
    for (int i = 0; i < 2; i++) {
        double e = 1.0 - (x * y) * (y * y);
        y += (y * e) * ((1.0 / 3.0 + e * (2.0 / 9.0)) + (e * e) * (14.0 / 81.0));
    }
    return y;
}

static void sine_cosine(double x, double *sine, double *cosine)
{
    const double round = 6755399441055744.0;
    double shifted = x * 0.6366197723675814 + round;
    int64_t quarter = bits(shifted);
    double k = shifted - round;
    double a = x - k * 1.5707963267341256, b = k * 6.077100506303966e-11;
    double r = a - b, rest = ((a - r) - b) - k * 2.0222662487959506e-21, z = r * r;
    double high = 2.755731610068303e-06 + z * (-2.5051131455427946e-08 + z * 1.591810123027412e-10);
    double p = 0.008333333333330946 + z * (-0.0001984126983675497 + z * high);
    double s = r + (r * z * (-0.16666666666666666 + z * p) + rest * (1.0 - 0.5 * z));
    high = -2.7557317270560326e-07 + z * (2.0876146024689747e-09 + z * -1.1382614868556325e-11);
    p = 0.041666666666666664 + z * (-0.0013888888888887395 + z * (2.4801587298763433e-05 + z * high));
    double half = 0.5 * z, w = 1.0 - half, c = w + (((1.0 - w) - half) + (z * z * p - r * rest));
    bool odd = quarter & 1;
    *sine = (odd ? c : s) * (quarter & 2 ? -1.0 : 1.0);
    *cosine = (odd ? s : c) * ((quarter + 1) & 2 ? -1.0 : 1.0);
}

static double u_of_indentation(double d)
{
    if (d <= INDENTATION_FIXED_GRIPS)
        return U_FIXED_GRIPS;
    double t = sqrt((d - INDENTATION_FIXED_GRIPS) * SCALE);
    double r = 1.0 / (0.5 + sqrt(2.1 + t)), r2 = r * r;
    double z = r * ((0.9999994440079478 + -0.4999525946326546 * r) +
                    ((0.29983788007852324 + -0.1578578490315034 * r) + -0.07757420208181724 * r2) * r2);
    double y = t * z, z2 = z * z;
    double slope = 1.0 / (z2 * (12.0 + y * (12.0 + 4.0 * y)));
    double e = (z2 * (6.0 + y * (4.0 + y)) - 1.0) * slope;
    y -= y * (e * (1.0 + 6.0 * z2 * slope * ((1.0 + y) * (1.0 + y)) * e));
    return U_FIXED_GRIPS + U_FIXED_GRIPS * y;
}

static double load_of_u(double u)
{
    double u3 = u * u * u;
    return 4.0 * (u3 * u3 - u3);
}

static double stiffness_of_u(double u)
{
    double u3 = u * u * u;
    return 18.0 * u * u * (2.0 * u3 - 1.0) / (6.0 * u3 - 1.0);
}

/* sample/paper.py */

static void surface(double x, double y, Surface *h, const Sample *p)
{
    double sin_x, cos_x, sin_y, cos_y;
    sine_cosine(p->k_x * x, &sin_x, &cos_x);
    sine_cosine(p->k_y * y, &sin_y, &cos_y);
    double height = p->beta * sin_x * sin_y;
    h->height = height;
    h->slope_x = p->beta * p->k_x * cos_x * sin_y;
    h->slope_y = p->beta * p->k_y * sin_x * cos_y;
    h->curvature = 0.5 * (p->k_x * p->k_x + p->k_y * p->k_y) * height;
    h->curvature_xx = -p->k_x * p->k_x * height;
    h->curvature_yy = -p->k_y * p->k_y * height;
    h->curvature_xy = p->beta * p->k_x * p->k_y * cos_x * cos_y;
    h->strength = 1.0;
}

/* contact/jkr.py */

static void radius_ratios(const Surface *h, double r, double *rho, double *third, double *inverse_third)
{
    double inverse = 1.0 + h->curvature * r;
    *third = inverse_cube_root(inverse);
    *rho = 1.0 / inverse;
    *inverse_third = inverse * (*third * *third);
}

/* contact/friction.py */

static double bound_of_area(double f_s, double rho, double rho_third, double u)
{
    double u2 = u * u;
    return f_s * AREA * rho * rho_third * u2 * u2;
}

static bool project_disc(double x, double y, double radius, double *j_x, double *j_y)
{
    double size2 = x * x + y * y;
    *j_x = x;
    *j_y = y;
    if (size2 <= radius * radius)
        return true;
    double inverse = 1.0 / sqrt(size2);
    *j_x = (x * inverse) * radius;
    *j_y = (y * inverse) * radius;
    return false;
}

static bool friction_impulse(double p_x, double p_y, double v_x, double v_y, double n_x, double n_y, double radius,
                             double *j_x, double *j_y)
{
    if (project_disc(p_x, p_y, radius, j_x, j_y))
        return true;
    double w_x = v_x + (p_x - *j_x) * n_x;
    double w_y = v_y + (p_y - *j_y) * n_y;
    double mid2 = w_x * w_x + w_y * w_y;
    double along = v_x * p_x + v_y * p_y;
    if (along > 0.0 && mid2 > 16.0 * radius * radius) {
        double size = sqrt(mid2);
        if (w_x * p_x + w_y * p_y >= radius * size) {
            double scale = (radius / mid2) * size;
            *j_x = w_x * scale;
            *j_y = w_y * scale;
        }
    }
    return false;
}

/* plant/lateral.py */

static void kick_lateral(const double *s, const Constants *p, double u_x, double u_y, double f, double *v_x, double *v_y,
                         double *f_x, double *f_y)
{
    double h = p->h;
    double p_x = p->keep_x * s[V_X] + h * (u_x - p->spring_x * s[X]);
    double p_y = p->keep_y * s[V_Y] + h * (u_y - p->spring_y * s[Y]);
    double j_x, j_y;
    bool stick = friction_impulse(p_x, p_y, s[V_X], s[V_Y], p->take_x, p->take_y, h * f, &j_x, &j_y);
    *v_x = stick ? 0.0 : (p_x - j_x) * p->take_x;
    *v_y = stick ? 0.0 : (p_y - j_y) * p->take_y;
    *f_x = j_x * p->inverse_h;
    *f_y = j_y * p->inverse_h;
}

/* plant/compliant.py */

static void step(const double *restrict v, const Constants *restrict p, double *restrict s, const Sample *restrict sample)
{
    double u_x = p->gain_x * v[0];
    double u_y = p->gain_y * v[1];
    double u_z = p->gain_z * v[2];
    double h = p->h;
    double half = 0.5 * h;
    s[X] += half * s[V_X];
    s[Y] += half * s[V_Y];
    s[Z] += half * s[V_Z];
    s[Q] += half * s[V_Q];

    Surface H;
    surface(s[X], s[Y], &H, sample);
    double rho, rho_third, inverse_third;
    radius_ratios(&H, p->r, &rho, &rho_third, &inverse_third);
    double delta = s[Z] + H.height - s[Q];
    double d = (delta * p->inverse_delta_0) * inverse_third;
    bool touching = delta >= 0.0 || (s[CONTACT] != 0.0 && d > INDENTATION_FIXED_GRIPS);
    s[CONTACT] = touching ? 1.0 : 0.0;
    double n_elastic = 0.0, dashpot = 0.0, f = 0.0;
    if (touching) {
        double u = u_of_indentation(d);
        double pull_off = p->L_s * rho;
        n_elastic = pull_off * load_of_u(u);
        double stiffness = (pull_off * (p->inverse_delta_0 * inverse_third)) * stiffness_of_u(u);
        dashpot = 2.0 * p->zeta_n * sqrt(larger(stiffness, 0.0));
        f = bound_of_area(p->f_s * H.strength, rho, rho_third, u);
    }

    double v_x, v_y;
    kick_lateral(s, p, u_x, u_y, f, &v_x, &v_y, &s[F_X], &s[F_Y]);
    s[F_MAX] = f;
    double v_z = (p->keep_z * s[V_Z] + h * ((u_z - p->spring_z * s[Z]) - n_elastic * p->inverse_mu)) * p->take_z;
    double v_q = (p->keep_c * s[V_Q] + h * (n_elastic - (p->w + p->spring_c * (s[Q] - p->a)))) * p->take_c;
    double g_z = (h * (p->inverse_mu * p->take_z)) * dashpot;
    double g_q = (h * p->take_c) * dashpot;
    double H_rate = 0.5 * (H.slope_x * (s[V_X] + v_x) + H.slope_y * (s[V_Y] + v_y));
    double delta_rate = (0.5 * (s[V_Z] + v_z - s[V_Q] - v_q) + H_rate) * (1.0 / (1.0 + 0.5 * (g_z + g_q)));
    s[V_X] = v_x;
    s[V_Y] = v_y;
    s[V_Z] = v_z - g_z * delta_rate;
    s[V_Q] = v_q + g_q * delta_rate;
    s[N] = n_elastic + dashpot * delta_rate;

    s[X] += half * s[V_X];
    s[Y] += half * s[V_Y];
    s[Z] += half * s[V_Z];
    s[Q] += half * s[V_Q];
}

/* Advance `s` by `ticks` x `hold` steps; row i of `u` is the drive (x, y, z) [V] held over the steps of tick i. */
void advance(double *restrict s, const double *restrict constants, const double *restrict sample, const double *restrict u,
             long ticks, long hold)
{
    for (long i = 0; i < ticks; i++)
        for (long j = 0; j < hold; j++)
            step(u + 3 * i, (const Constants *)constants, s, (const Sample *)sample);
}
