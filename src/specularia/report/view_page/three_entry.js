// What the viewer takes from three.js; see README.md for the command that makes three.min.js of it.
export {
  AmbientLight, BufferAttribute, BufferGeometry, ColorManagement, DirectionalLight, DoubleSide,
  LinearSRGBColorSpace, Line, LineBasicMaterial, LineLoop, LineSegments, Mesh, MeshBasicMaterial,
  MeshLambertMaterial, OrthographicCamera, Scene, Vector3, WebGLRenderer, REVISION,
} from "three";
