"""Makes small.onnx, and prints the embeddings of three images by ONNX Runtime's own Python package.

pip install numpy onnx==1.23.2 onnxruntime==1.28.0; python small.py
"""

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

random = np.random.default_rng(1)
constants = []


def constant(name, *shape):
    values = (random.standard_normal(shape) / np.sqrt(np.prod(shape[1:]))).astype(np.float32)
    constants.append(numpy_helper.from_array(values, name))
    return name


constants.append(numpy_helper.from_array(np.float32(255), "white"))
nodes = [
    helper.make_node("Div", ["images", "white"], ["scaled"]),
    helper.make_node("Conv", ["scaled", constant("w1", 4, 1, 3, 3), constant("b1", 4)], ["c"],
                     kernel_shape=[3, 3], strides=[2, 2], pads=[1, 1, 1, 1]),
    helper.make_node("GroupNormalization", ["c", constant("scale", 4), constant("shift", 4)], ["n"],
                     num_groups=2, epsilon=1e-5),
    helper.make_node("LeakyRelu", ["n"], ["r"], alpha=0.01),
    helper.make_node("AveragePool", ["r"], ["p"], kernel_shape=[2, 2], strides=[2, 2]),
    helper.make_node("Flatten", ["p"], ["f"], axis=1),
    helper.make_node("Gemm", ["f", constant("w2", 8, 24), constant("b2", 8)], ["d"], transB=1),
    helper.make_node("Relu", ["d"], ["e"]),
    helper.make_node("Gemm", ["e", constant("w3", 3, 8), constant("b3", 3)], ["embedding"], transB=1),
]
graph = helper.make_graph(
    nodes, "small",
    [helper.make_tensor_value_info("images", TensorProto.FLOAT, ["batch", 1, 12, 8])],
    [helper.make_tensor_value_info("embedding", TensorProto.FLOAT, ["batch", 3])],
    constants,
)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 21)], ir_version=10)
onnx.checker.check_model(model, full_check=True)
onnx.save(model, "small.onnx")

pixels = np.arange(96)
images = np.stack([(pixels * (7 + 4 * k) + 31 * k) % 256 for k in range(3)]).astype(np.float32)
session = onnxruntime.InferenceSession("small.onnx", providers=["CPUExecutionProvider"])
for row in session.run(None, {"images": images.reshape(3, 1, 12, 8)})[0]:
    print("[" + ", ".join(f"{value:.9}" for value in row) + "],")
