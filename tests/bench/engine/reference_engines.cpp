#include "tests/bench/engine/reference_engines.h"

#include <utility>

#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <btBulletCollisionCommon.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>

namespace tenon::bench {

namespace {

constexpr std::size_t kAllContacts = 100'000;

using FclModel = fcl::BVHModel<fcl::OBBRSSd>;

std::shared_ptr<FclModel> fclModel(const bake::TriangleMesh& mesh) {
  auto model = std::make_shared<FclModel>();
  std::vector<fcl::Vector3d> vertices;
  for (const Vector3f& vertex : mesh.vertices) vertices.push_back(vertex.cast<double>());
  std::vector<fcl::Triangle> triangles;
  for (const auto& triangle : mesh.triangles) triangles.emplace_back(triangle[0], triangle[1], triangle[2]);
  model->beginModel(static_cast<int>(triangles.size()), static_cast<int>(vertices.size()));
  model->addSubModel(vertices, triangles);
  model->endModel();
  return model;
}

class Fcl : public ReferenceEngine {
 public:
  Fcl(std::shared_ptr<FclModel> a, std::shared_ptr<FclModel> b, bool all)
      : a_(std::move(a)), b_(std::move(b)), request_(all ? kAllContacts : 1, all), all_(all) {}
  [[nodiscard]] std::string name() const override {
    return all_ ? "FCL, all contacts" : "FCL, first contact only";
  }
  std::size_t contacts(const Pose& X_BA) override {
    fcl::Transform3d X = fcl::Transform3d::Identity();
    X.linear() = X_BA.matrix();
    X.translation() = X_BA.translation();
    fcl::CollisionResultd result;
    fcl::collide(a_.get(), X, b_.get(), fcl::Transform3d::Identity(), request_, result);
    return result.numContacts();
  }

 private:
  std::shared_ptr<FclModel> a_, b_;
  fcl::CollisionRequestd request_;
  bool all_;
};

/// A mesh as Bullet shape, with the arrays that the shape refers to.
class BulletBody {
 public:
  explicit BulletBody(const bake::TriangleMesh& mesh) {
    for (const Vector3f& vertex : mesh.vertices)
      for (const float coordinate : vertex) vertices_.push_back(coordinate);
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t corner : triangle) indices_.push_back(static_cast<int>(corner));
    triangles_ = std::make_unique<btTriangleIndexVertexArray>(
        static_cast<int>(mesh.triangles.size()), indices_.data(), 3 * static_cast<int>(sizeof(int)),
        static_cast<int>(mesh.vertices.size()), vertices_.data(), 3 * static_cast<int>(sizeof(btScalar)));
    shape_ = std::make_unique<btGImpactMeshShape>(triangles_.get());
    shape_->setMargin(0.0);
    shape_->updateBound();
    object.setCollisionShape(shape_.get());
  }

  btCollisionObject object;

 private:
  std::vector<btScalar> vertices_;
  std::vector<int> indices_;
  std::unique_ptr<btTriangleIndexVertexArray> triangles_;
  std::unique_ptr<btGImpactMeshShape> shape_;
};

class Bullet : public ReferenceEngine {
 public:
  Bullet(const bake::TriangleMesh& mesh_A, const bake::TriangleMesh& mesh_B)
      : a_(mesh_A), b_(mesh_B), dispatcher_(&configuration_) {
    btGImpactCollisionAlgorithm::registerAlgorithm(&dispatcher_);
  }

  [[nodiscard]] std::string name() const override { return "Bullet, GImpact"; }
  std::size_t contacts(const Pose& X_BA) override {
    const Quaternion& q = X_BA.rotation();
    const Vector3& p = X_BA.translation();
    a_.object.setWorldTransform(
        btTransform(btQuaternion(q.x(), q.y(), q.z(), q.w()), btVector3(p.x(), p.y(), p.z())));
    const btCollisionObjectWrapper a(nullptr, a_.object.getCollisionShape(), &a_.object,
                                     a_.object.getWorldTransform(), -1, -1);
    const btCollisionObjectWrapper b(nullptr, b_.object.getCollisionShape(), &b_.object,
                                     b_.object.getWorldTransform(), -1, -1);
    Counter counter(&a, &b);
    btCollisionAlgorithm* algorithm = dispatcher_.findAlgorithm(&a, &b, nullptr, BT_CONTACT_POINT_ALGORITHMS);
    algorithm->processCollision(&a, &b, dispatch_info_, &counter);
    algorithm->~btCollisionAlgorithm();
    dispatcher_.freeCollisionAlgorithm(algorithm);
    return counter.count;
  }

 private:
  struct Counter : btManifoldResult {
    using btManifoldResult::btManifoldResult;
    void addContactPoint(const btVector3& /*normal*/, const btVector3& /*point*/,
                         btScalar /*depth*/) override {
      ++count;
    }
    std::size_t count = 0;
  };

  BulletBody a_, b_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDispatcherInfo dispatch_info_;
};

}  // namespace

std::vector<std::unique_ptr<ReferenceEngine>> referenceEngines(const bake::TriangleMesh& mesh_A,
                                                               const bake::TriangleMesh& mesh_B) {
  const auto a = fclModel(mesh_A);
  const auto b = fclModel(mesh_B);
  std::vector<std::unique_ptr<ReferenceEngine>> engines;
  engines.push_back(std::make_unique<Fcl>(a, b, true));
  engines.push_back(std::make_unique<Fcl>(a, b, false));
  engines.push_back(std::make_unique<Bullet>(mesh_A, mesh_B));
  return engines;
}

}  // namespace tenon::bench
