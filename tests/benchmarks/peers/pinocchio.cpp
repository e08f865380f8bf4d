/* N four-bars in Pinocchio: a tree of 2N + 1 rods, N loops closed by constraints with Baumgarte's terms, RK4. */
#include <chrono>
#include <pinocchio/fwd.hpp>
#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/multibody.hpp>

using namespace pinocchio;
using Eigen::Vector3d;
using Eigen::VectorXd;

static SE3 at(double x, double y) { return SE3(Eigen::Matrix3d::Identity(), Vector3d(x, y, 0)); }

static JointIndex rod(Model &model, JointIndex parent, const SE3 &place, double x, double y)
{
    const JointIndex joint = model.addJoint(parent, JointModelRZ(), place, "joint" + std::to_string(model.njoints));
    const Vector3d tensor(y / 12 + 1e-9, x / 12 + 1e-9, 1.0 / 12);
    model.appendBodyToJoint(joint, Inertia(1, Vector3d(x / 2, y / 2, 0), tensor.asDiagonal().toDenseMatrix()), SE3::Identity());
    return joint;
}

/* B0 after every interval into xy, from the start on; returns the seconds of the integration. omega: of Baumgarte's terms. */
extern "C" double four_bars(int count, double duration, int intervals, int steps, double omega, double *xy)
{
    Model model;
    model.gravity.linear() = Vector3d(0, -9.81, 0);
    std::vector<JointIndex> standing, lying;
    for (int i = 0; i <= count; i++) { /* every branch of the tree to its end: Pinocchio numbers joints depth first */
        standing.push_back(rod(model, 0, at(i, 0), 0, 1));
        if (i < count) lying.push_back(rod(model, standing[i], at(0, 1), 1, 0));
    }
    std::vector<RigidConstraintModel> loops;
    std::vector<RigidConstraintData> loop_data;
    for (int i = 0; i < count; i++) {
        RigidConstraintModel loop(CONTACT_3D, model, lying[i], at(1, 0), standing[i + 1], at(0, 1), LOCAL);
        loop.setBaumgarteCorrectorParameters(BaumgarteCorrectorParametersTpl<double>(omega * omega, 2 * omega));
        loops.push_back(loop);
    }
    for (const auto &loop : loops) loop_data.push_back(RigidConstraintData(loop));
    Data data(model);
    initConstraintDynamics(model, data, loops, loop_data);
    ProximalSettings settings(1e-12, 1e-10, 20);
    VectorXd q = VectorXd::Zero(model.nq), v = VectorXd::Zero(model.nv);
    const VectorXd none = VectorXd::Zero(model.nv);
    for (JointIndex joint : standing) v[model.joints[joint].idx_v()] = -1;
    for (JointIndex joint : lying) v[model.joints[joint].idx_v()] = 1;
    const auto acceleration = [&](const VectorXd &q, const VectorXd &v) -> VectorXd {
        return constraintDynamics(model, data, q, v, none, loops, loop_data, settings);
    };
    const double h = duration / intervals / steps;
    const auto start = std::chrono::steady_clock::now();
    for (int k = 0; k <= intervals; k++) {
        xy[2 * k] = -std::sin(q[0]);
        xy[2 * k + 1] = std::cos(q[0]);
        for (int i = 0; k < intervals && i < steps; i++) {
            const VectorXd a1 = acceleration(q, v);
            const VectorXd a2 = acceleration(q + h / 2 * v, v + h / 2 * a1);
            const VectorXd a3 = acceleration(q + h / 2 * v + h * h / 4 * a1, v + h / 2 * a2);
            const VectorXd a4 = acceleration(q + h * v + h * h / 2 * a2, v + h * a3);
            q += h * v + h * h / 6 * (a1 + a2 + a3);
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
        }
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}
