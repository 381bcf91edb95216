//! Lists the random spheres of Table 1: `cargo run -p rayset-scene --example spheres`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use rayset_scene::{RandomSpheres, SceneError};

fn main() -> Result<(), SceneError> {
    for count in [1, 2, 4, 8] {
        let scene = RandomSpheres { count, seed: 1, ..RandomSpheres::default() }.scene()?;
        println!("{count} spheres:");
        for object in scene.objects() {
            println!("  {} at {:.3}, radius {:.3}", object.name, object.bounds.center, object.bounds.radius);
        }
    }
    Ok(())
}
