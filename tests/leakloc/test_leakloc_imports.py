import subprocess
import sys


def test_importing_leakloc_loads_numpy_opencv_and_scipy_at_most():
    program = "import sys, leakloc; print(*{name.partition('.')[0] for name in sys.modules})"
    loaded = set(
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    )
    assert "leakloc" in loaded
    strangers = {"trimesh", "embreex", "simcam", "noise", "scenarios", "pydantic", "click", "matplotlib", "tqdm"}
    assert loaded.isdisjoint(strangers)
