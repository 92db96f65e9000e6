// What the graphics hardware holds of an object is given back only when it is told to.
import { Material, Mesh, type BufferGeometry, type Object3D, Texture } from "three";

/** Gives back geometries, materials and textures of an object and of all below it, but not the `kept` materials. */
export function release(object: Object3D, ...kept: Material[]): void {
  object.traverse((child) => {
    const { geometry, material } = child as Partial<Mesh<BufferGeometry, Material | Material[]>>;
    geometry?.dispose();
    for (const one of [material ?? []].flat()) if (!kept.includes(one)) releaseMaterial(one);
  });
}

function releaseMaterial(material: Material): void {
  for (const value of Object.values(material)) if (value instanceof Texture) value.dispose();
  material.dispose();
}
