//! One embedder, ready to run on one thread.

use super::{Device, Runtime, device::open_session};
use murmuration_onnx::{EmbedderModel, ImageShape};
use ort::{session::Session, value::TensorRef};

/// Maximum number of images in a batch: larger batches are no faster and take more memory.
pub const MAX_BATCH: usize = 32;

/// Maximum number of elements of a model's largest tensor for a whole batch (64 MiB of floats).
const MAX_BATCH_ELEMENTS: usize = 16 << 20;

/// A checkpoint, opened in its own single-threaded session of ONNX Runtime.
#[derive(Debug)]
pub struct Embedder {
    session: Session,
    device: Device,
    model: EmbedderModel,
    batch: usize,
    /// The pixels of a batch in the model's input format.
    pixels: Vec<f32>,
    enlarged: Option<Enlarged>,
}

/// How the pixels of a picture become those of the model's image, for the last picture that did not have the image's shape.
#[derive(Debug)]
struct Enlarged {
    pictures: ImageShape,
    /// [`ImageShape::nearest_pixels`] of the model's images.
    pixels: Vec<usize>,
}

/// Why images were not embedded.
#[derive(Debug, thiserror::Error)]
pub enum EmbedError {
    /// ONNX Runtime cannot run the model.
    #[error("ONNX Runtime: {0}")]
    Runtime(#[source] ort::Error),
    /// A card cannot run the model, for instance because its memory is full. A processor, or another card, may be able to.
    #[error("ONNX Runtime on {device}: {error}")]
    Card { device: Device, error: ort::Error },
    /// An image has neither the size that the model takes nor a size that can be enlarged to it.
    #[error("image {index} has {pixels} pixels: this embedder takes {images}, or smaller squares")]
    ImageSize {
        /// Index of the image, from 0.
        index: usize,
        /// Number of pixels of the image, over all channels.
        pixels: usize,
        images: ImageShape,
    },
    /// The shape of the model's output differs from the shape that the model declares.
    #[error("the model made a value of shape {shape:?}, not {images} x {dimensions}")]
    OutputShape {
        shape: Vec<i64>,
        /// Number of input images.
        images: usize,
        /// Declared length of an embedding.
        dimensions: usize,
    },
    /// An embedding has a number that is infinite or NaN.
    #[error("image {index} is embedded as {value}, not as a finite number")]
    NotFinite {
        /// Index of the image, from 0.
        index: usize,
        value: f32,
    },
}

impl Embedder {
    /// An embedder that runs `model`.
    ///
    /// # Errors
    /// Fails if ONNX Runtime refuses the model, for instance because this version lacks an operator.
    pub fn open(runtime: &Runtime, model: EmbedderModel) -> Result<Self, EmbedError> {
        let device = runtime.device();
        let session = open_session(runtime.environment(), device, model.encoded())
            .map_err(|error| refused(device, error))?;
        let batch = match model.takes_batches() {
            true => MAX_BATCH_ELEMENTS / model.largest_value().max(1),
            false => 1,
        };
        Ok(Self {
            session,
            device,
            batch: batch.clamp(1, MAX_BATCH),
            pixels: Vec::new(),
            enlarged: None,
            model,
        })
    }

    #[must_use]
    pub const fn model(&self) -> &EmbedderModel {
        &self.model
    }

    /// The embeddings of `images`, in order.
    ///
    /// An image is raw grey values, channel by channel; a pixel of a channel has index `x * width + y` (axis 0 is x), as in an
    /// evaluation. An image is a square picture that the model [takes](ImageShape::takes), or has the shape of the model's images.
    /// A smaller picture is enlarged: each pixel becomes that of the nearest pixel. An embedding has
    /// [`EmbedderModel::dimensions`] numbers, all finite. On one kind of CPU and with one build of ONNX Runtime, the bits of an
    /// embedding do not depend on the other images or on their number.
    ///
    /// # Errors
    /// Fails if an image has the wrong size, or if an embedding has the wrong shape or is not finite. If any check fails, no
    /// embedding is returned.
    pub fn embed(&mut self, images: &[&[u8]]) -> Result<Vec<Vec<f32>>, EmbedError> {
        let shape = self.model.images();
        if let Some((index, image)) = images
            .iter()
            .enumerate()
            .find(|(_, image)| shape.of_pictures(image.len()).is_none())
        {
            return Err(EmbedError::ImageSize {
                index,
                pixels: image.len(),
                images: shape,
            });
        }
        let mut embeddings = Vec::with_capacity(images.len());
        for batch in images.chunks(self.batch) {
            self.embed_batch(batch, &mut embeddings)?;
        }
        Ok(embeddings)
    }

    fn embed_batch(&mut self, images: &[&[u8]], embeddings: &mut Vec<Vec<f32>>) -> Result<(), EmbedError> {
        self.pixels.clear();
        for image in images {
            self.add_pixels(image);
        }
        let Self {
            session,
            device,
            model,
            pixels,
            ..
        } = self;
        let refused = |error| refused(*device, error);
        let ImageShape {
            channels,
            height,
            width,
        } = model.images();
        let shape = [images.len(), channels, height, width];
        let input = TensorRef::from_array_view((shape, pixels.as_slice())).map_err(refused)?;
        let outputs = session.run([input.into()]).map_err(refused)?;
        let (shape, values) = outputs[0].try_extract_tensor::<f32>().map_err(refused)?;
        let dimensions = model.dimensions();
        if shape[..] != [images.len() as i64, dimensions as i64] {
            return Err(EmbedError::OutputShape {
                shape: shape.to_vec(),
                images: images.len(),
                dimensions,
            });
        }
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let index = embeddings.len() + at / dimensions;
            return Err(EmbedError::NotFinite {
                index,
                value: values[at],
            });
        }
        embeddings.extend(values.chunks_exact(dimensions).map(<[f32]>::to_vec));
        Ok(())
    }

    /// Adds an image of the model for `picture`.
    fn add_pixels(&mut self, picture: &[u8]) {
        let images = self.model.images();
        let Some(pictures) = images
            .of_pictures(picture.len())
            .filter(|&pictures| pictures != images)
        else {
            self.pixels.extend(picture.iter().map(|&pixel| f32::from(pixel)));
            return;
        };
        let enlarged = self
            .enlarged
            .take()
            .filter(|enlarged| enlarged.pictures == pictures);
        let enlarged = self.enlarged.insert(enlarged.unwrap_or_else(|| Enlarged {
            pictures,
            pixels: images.nearest_pixels(pictures),
        }));
        let pixels = enlarged.pixels.iter();
        self.pixels.extend(pixels.map(|&at| f32::from(picture[at])));
    }
}

fn refused(device: Device, error: ort::Error) -> EmbedError {
    match device {
        Device::Cpu => EmbedError::Runtime(error),
        Device::Cuda => EmbedError::Card { device, error },
    }
}
