/* The model of an arm as libfranka 0.9 loads it. model_library.py puts the arm's numbers before this text:

   AXIS, ANCHOR        of each joint: direction, and a point on it [m]
   HOME_R, HOME_P      of the link behind each joint, and of the flange: orientation row by row, and origin [m]
   MASS, COM, INERTIA  of what each joint moves and the next one does not, without what the flange carries
                       [kg], [m], about the centre of mass row by row [kg m^2]

   All are those with the joints at 0, in the base frame. The interface has its matrices column by column, velocities
   before angular velocities. */
#include <math.h>

enum { JOINTS = 7, FLANGE = JOINTS, X = 3, XX = X * X };

typedef struct {
    double R[XX], p[X]; /* the orientation row by row */
} Pose;

typedef struct {
    double axis[JOINTS][X], anchor[JOINTS][X];
    Pose moved[JOINTS]; /* where a joint, and those before it, have brought what was in the base frame */
} Arm;

typedef struct {
    double mass, com[X], inertia[XX];
    int joint; /* the last one that moves it */
} Body;

static void cross(const double a[X], const double b[X], double out[X]) {
    for (int i = 0; i < X; i++) out[i] = a[(i + 1) % X] * b[(i + 2) % X] - a[(i + 2) % X] * b[(i + 1) % X];
}

static double dot(const double a[X], const double b[X]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void turn(const double R[XX], const double a[X], double out[X]) {
    for (int i = 0; i < X; i++) out[i] = dot(R + X * i, a);
}

static void bring(const Pose *to, const double a[X], double out[X]) {
    turn(to->R, a, out);
    for (int i = 0; i < X; i++) out[i] += to->p[i];
}

static void product(const double A[XX], const double B[XX], double out[XX]) {
    for (int i = 0; i < X; i++)
        for (int j = 0; j < X; j++) {
            const double column[X] = {B[j], B[X + j], B[2 * X + j]};
            out[X * i + j] = dot(A + X * i, column);
        }
}

/* I in a frame whose orientation is R: R I R^T. */
static void turn_inertia(const double R[XX], const double I[XX], double out[XX]) {
    double half[XX];
    product(R, I, half);
    for (int i = 0; i < X; i++)
        for (int j = 0; j < X; j++) out[X * i + j] = dot(half + X * i, R + X * j);
}

/* Rodrigues: the rotation by an angle [rad] about a unit vector. */
static void rotation(const double a[X], double angle, double out[XX]) {
    const double s = sin(angle), c = cos(angle);
    for (int i = 0; i < X; i++)
        for (int j = 0; j < X; j++) out[X * i + j] = (i == j) * c + (1.0 - c) * a[i] * a[j];
    for (int i = 0; i < X; i++) {
        const int j = (i + 1) % X, k = (i + 2) % X;
        out[X * k + j] += s * a[i];
        out[X * j + k] -= s * a[i];
    }
}

static Arm arm_at(const double q[JOINTS]) {
    Arm arm;
    Pose before = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
    for (int j = 0; j < JOINTS; j++) {
        double turned[XX], back[X];
        Pose *moved = &arm.moved[j];
        turn(before.R, AXIS[j], arm.axis[j]);
        bring(&before, ANCHOR[j], arm.anchor[j]);
        rotation(AXIS[j], q[j], turned);
        product(before.R, turned, moved->R);
        turn(moved->R, ANCHOR[j], back);
        for (int i = 0; i < X; i++) moved->p[i] = arm.anchor[j][i] - back[i];
        before = *moved;
    }
    return arm;
}

static int joint_of(int frame) { return frame < FLANGE ? frame : JOINTS - 1; }

static Pose pose_of(const Arm *arm, int frame) {
    const Pose *moved = &arm->moved[joint_of(frame)];
    Pose pose;
    product(moved->R, HOME_R[frame], pose.R);
    bring(moved, HOME_P[frame], pose.p);
    return pose;
}

static Pose end_effector_of(const Arm *arm, const double F_T_EE[16]) {
    const Pose flange = pose_of(arm, FLANGE);
    Pose on_flange, pose;
    for (int i = 0; i < X; i++) {
        for (int j = 0; j < X; j++) on_flange.R[X * i + j] = F_T_EE[4 * j + i];
        on_flange.p[i] = F_T_EE[12 + i];
    }
    product(flange.R, on_flange.R, pose.R);
    bring(&flange, on_flange.p, pose.p);
    return pose;
}

static void write_pose(const Pose *pose, double T[16]) {
    for (int i = 0; i < X; i++) {
        for (int j = 0; j < X; j++) T[4 * j + i] = pose->R[X * i + j];
        T[12 + i] = pose->p[i];
        T[4 * i + 3] = 0.0;
    }
    T[15] = 1.0;
}

/* How fast a joint moves a point. */
static void lever(const Arm *arm, int joint, const double point[X], double out[X]) {
    double from_axis[X];
    for (int i = 0; i < X; i++) from_axis[i] = point[i] - arm->anchor[joint][i];
    cross(arm->axis[joint], from_axis, out);
}

/* Jacobian of a pose that the joints up to one move; with `inward`, by the axes of that pose. */
static void write_jacobian(const Arm *arm, const Pose *pose, int joint, int inward, double J[6 * JOINTS]) {
    for (int k = 0; k < 6 * JOINTS; k++) J[k] = 0.0;
    for (int k = 0; k <= joint; k++) {
        double velocity[X];
        lever(arm, k, pose->p, velocity);
        for (int i = 0; i < X; i++) {
            double *column = J + 6 * k;
            const double along[X] = {pose->R[i], pose->R[X + i], pose->R[2 * X + i]};
            column[i] = inward ? dot(along, velocity) : velocity[i];
            column[X + i] = inward ? dot(along, arm->axis[k]) : arm->axis[k][i];
        }
    }
}

static Body body_of(const Arm *arm, int joint) {
    Body body = {.mass = MASS[joint], .joint = joint};
    bring(&arm->moved[joint], COM[joint], body.com);
    turn_inertia(arm->moved[joint].R, INERTIA[joint], body.inertia);
    return body;
}

static Body load_of(const Arm *arm, const double I_load[9], double m_load, const double F_x_Cload[X]) {
    const Pose flange = pose_of(arm, FLANGE);
    Body body = {.mass = m_load, .joint = JOINTS - 1};
    double inertia[XX];
    for (int i = 0; i < X; i++)
        for (int j = 0; j < X; j++) inertia[X * i + j] = I_load[X * j + i];
    bring(&flange, F_x_Cload, body.com);
    turn_inertia(flange.R, inertia, body.inertia);
    return body;
}

static void add_mass(const Arm *arm, const Body *body, double M[JOINTS * JOINTS]) {
    for (int k = 0; k <= body->joint; k++) {
        double velocity[X], momentum[X];
        lever(arm, k, body->com, velocity);
        turn(body->inertia, arm->axis[k], momentum);
        for (int j = 0; j <= body->joint; j++) {
            double other[X];
            lever(arm, j, body->com, other);
            M[JOINTS * k + j] += body->mass * dot(velocity, other) + dot(momentum, arm->axis[j]);
        }
    }
}

/* Torques at the joints against a force at the body's centre of mass and a moment. */
static void add_torques(
    const Arm *arm, const Body *body, const double force[X], const double moment[X], double tau[JOINTS]
) {
    for (int k = 0; k <= body->joint; k++) {
        double velocity[X];
        lever(arm, k, body->com, velocity);
        tau[k] += dot(velocity, force) + dot(arm->axis[k], moment);
    }
}

/* Twist of a body, of which the point at the base's origin is looked at. */
typedef struct {
    double w[X], v[X];
} Twist;

/* Twists that the joints' velocities give their links, and the twists' rates of change at steady joint velocities. */
static void motion_of(const Arm *arm, const double dq[JOINTS], Twist twist[JOINTS], Twist rate[JOINTS]) {
    Twist moves = {{0}, {0}}, changes = {{0}, {0}};
    for (int j = 0; j < JOINTS; j++) {
        Twist own, a;
        double b[X];
        cross(arm->anchor[j], arm->axis[j], own.v);
        for (int i = 0; i < X; i++) {
            own.w[i] = arm->axis[j][i] * dq[j];
            own.v[i] *= dq[j];
        }
        cross(moves.w, own.w, a.w);
        cross(moves.w, own.v, a.v);
        cross(moves.v, own.w, b);
        for (int i = 0; i < X; i++) {
            changes.w[i] += a.w[i];
            changes.v[i] += a.v[i] + b[i];
            moves.w[i] += own.w[i];
            moves.v[i] += own.v[i];
        }
        twist[j] = moves;
        rate[j] = changes;
    }
}

static void add_coriolis(const Arm *arm, const Body *body, const Twist *twist, const Twist *rate, double c[JOINTS]) {
    double velocity[X], turning[X], centripetal[X], spin[X], force[X], moment[X], gyroscopic[X];
    cross(twist->w, body->com, velocity);
    for (int i = 0; i < X; i++) velocity[i] += twist->v[i];
    cross(rate->w, body->com, turning);
    cross(twist->w, velocity, centripetal);
    turn(body->inertia, twist->w, spin);
    cross(twist->w, spin, gyroscopic);
    turn(body->inertia, rate->w, moment);
    for (int i = 0; i < X; i++) {
        force[i] = body->mass * (rate->v[i] + turning[i] + centripetal[i]);
        moment[i] += gyroscopic[i];
    }
    add_torques(arm, body, force, moment, c);
}

static void add_gravity(const Arm *arm, const Body *body, const double g_earth[X], double g[JOINTS]) {
    const double no_moment[X] = {0, 0, 0};
    double force[X];
    for (int i = 0; i < X; i++) force[i] = -body->mass * g_earth[i];
    add_torques(arm, body, force, no_moment, g);
}

/* What libfranka calls. J1 to J7 are the joints' links, J8 the flange, J9 the end-effector; what the first joint does
   does not depend on its own angle, if its link's frame is on its axis. */

static void pose_function(const double q[JOINTS], int frame, double T[16]) {
    const Arm arm = arm_at(q);
    const Pose pose = pose_of(&arm, frame);
    write_pose(&pose, T);
}

static void jacobian_function(const double q[JOINTS], int frame, int inward, double J[6 * JOINTS]) {
    const Arm arm = arm_at(q);
    const Pose pose = pose_of(&arm, frame);
    write_jacobian(&arm, &pose, joint_of(frame), inward, J);
}

static const double ZERO[JOINTS] = {0};

void O_T_J1(const double q[JOINTS], double T[16]) { pose_function(q, 0, T); }
void O_J_J1(double J[6 * JOINTS]) { jacobian_function(ZERO, 0, 0, J); }
void Ji_J_J1(double J[6 * JOINTS]) { jacobian_function(ZERO, 0, 1, J); }

#define FRAME(number)                                                                                            \
    void O_T_J##number(const double q[JOINTS], double T[16]) { pose_function(q, number - 1, T); }                \
    void O_J_J##number(const double q[JOINTS], double J[6 * JOINTS]) { jacobian_function(q, number - 1, 0, J); } \
    void Ji_J_J##number(const double q[JOINTS], double J[6 * JOINTS]) { jacobian_function(q, number - 1, 1, J); }

FRAME(2)
FRAME(3)
FRAME(4)
FRAME(5)
FRAME(6)
FRAME(7)
FRAME(8)

void O_T_J9(const double q[JOINTS], const double F_T_EE[16], double T[16]) {
    const Arm arm = arm_at(q);
    const Pose pose = end_effector_of(&arm, F_T_EE);
    write_pose(&pose, T);
}

static void end_effector_jacobian(const double q[JOINTS], const double F_T_EE[16], int inward, double J[6 * JOINTS]) {
    const Arm arm = arm_at(q);
    const Pose pose = end_effector_of(&arm, F_T_EE);
    write_jacobian(&arm, &pose, JOINTS - 1, inward, J);
}

void O_J_J9(const double q[JOINTS], const double F_T_EE[16], double J[6 * JOINTS]) {
    end_effector_jacobian(q, F_T_EE, 0, J);
}

void Ji_J_J9(const double q[JOINTS], const double F_T_EE[16], double J[6 * JOINTS]) {
    end_effector_jacobian(q, F_T_EE, 1, J);
}

void M_NE(
    const double q[JOINTS], const double I_load[9], double m_load, const double F_x_Cload[X], double M[JOINTS * JOINTS]
) {
    const Arm arm = arm_at(q);
    const Body load = load_of(&arm, I_load, m_load, F_x_Cload);
    for (int k = 0; k < JOINTS * JOINTS; k++) M[k] = 0.0;
    for (int j = 0; j < JOINTS; j++) {
        const Body body = body_of(&arm, j);
        add_mass(&arm, &body, M);
    }
    add_mass(&arm, &load, M);
}

void c_NE(
    const double q[JOINTS], const double dq[JOINTS], const double I_load[9], double m_load, const double F_x_Cload[X],
    double c[JOINTS]
) {
    const Arm arm = arm_at(q);
    const Body load = load_of(&arm, I_load, m_load, F_x_Cload);
    Twist twist[JOINTS], rate[JOINTS];
    motion_of(&arm, dq, twist, rate);
    for (int j = 0; j < JOINTS; j++) c[j] = 0.0;
    for (int j = 0; j < JOINTS; j++) {
        const Body body = body_of(&arm, j);
        add_coriolis(&arm, &body, &twist[j], &rate[j], c);
    }
    add_coriolis(&arm, &load, &twist[JOINTS - 1], &rate[JOINTS - 1], c);
}

void g_NE(
    const double q[JOINTS], const double g_earth[X], double m_load, const double F_x_Cload[X], double g[JOINTS]
) {
    static const double no_inertia[9] = {0};
    const Arm arm = arm_at(q);
    const Body load = load_of(&arm, no_inertia, m_load, F_x_Cload);
    for (int j = 0; j < JOINTS; j++) g[j] = 0.0;
    for (int j = 0; j < JOINTS; j++) {
        const Body body = body_of(&arm, j);
        add_gravity(&arm, &body, g_earth, g);
    }
    add_gravity(&arm, &load, g_earth, g);
}
