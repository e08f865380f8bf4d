/* An open tree of hinges in Pinocchio, with the face of a kernel: accelerations of the angles by the articulated-body algorithm. */
#include <pinocchio/fwd.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/multibody.hpp>

using namespace pinocchio;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

struct Arm {
    Model model;
    std::unique_ptr<Data> data;
    std::vector<int> place, rate;
    VectorXd sign, q, v, none;
};
static Arm arm;

/* parent: -1 for the ground; place, rate: of every angle in q and among the rates; numbers: 26 a hinge: sign, rotation by rows, offset,
 * mass, centre, inertia about the centre by rows */
extern "C" void pinocchio_make(int count, const int *parent, const int *place, const int *rate, const double *numbers, const double *gravity)
{
    arm = Arm();
    arm.model.gravity.linear() = Eigen::Map<const Vector3d>(gravity);
    arm.sign.resize(count);
    for (int i = 0; i < count; i++) {
        const double *own = numbers + 26 * i;
        const SE3 at(Eigen::Map<const Rows>(own + 1), Eigen::Map<const Vector3d>(own + 10));
        const JointIndex joint = arm.model.addJoint(parent[i] + 1, JointModelRZ(), at, "joint" + std::to_string(i));
        const Inertia inertia(own[13], Eigen::Map<const Vector3d>(own + 14), Matrix3d(Eigen::Map<const Rows>(own + 17)));
        arm.model.appendBodyToJoint(joint, inertia, SE3::Identity());
        arm.sign[i] = own[0];
    }
    arm.data.reset(new Data(arm.model));
    arm.place.assign(place, place + count);
    arm.rate.assign(rate, rate + count);
    arm.q = arm.v = arm.none = VectorXd::Zero(count);
}

extern "C" int pinocchio_gamma(double, const double *q, const double *qd, const double *, double *out)
{
    const int count = (int)arm.place.size();
    for (int i = 0; i < count; i++) {
        arm.q[i] = arm.sign[i] * q[arm.place[i]];
        arm.v[i] = arm.sign[i] * qd[arm.rate[i]];
    }
    aba(arm.model, *arm.data, arm.q, arm.v, arm.none);
    for (int i = 0; i < count; i++)
        out[arm.rate[i]] = arm.sign[i] * arm.data->ddq[i];
    return 0;
}
