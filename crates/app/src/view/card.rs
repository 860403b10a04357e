//! A graphics card without a window.

use eframe::egui_wgpu::wgpu;

/// What helps where no graphics driver answers.
pub const DRIVERS: &str =
    "on Debian without a graphics card install mesa-vulkan-drivers, or set WGPU_BACKEND=gl";

/// A graphics card, or the processor in the place of one.
pub struct Card {
    /// What makes things on it.
    pub device: wgpu::Device,
    /// What it is told to do.
    pub queue: wgpu::Queue,
    /// Its name.
    pub name: String,
}

impl Card {
    /// The fastest that there is; `WGPU_BACKEND` chooses among drivers.
    ///
    /// # Errors
    /// Why there is none, and what helps.
    pub fn open() -> Result<Self, String> {
        let lacks = |why: String| {
            let why = why.replace(';', ",");
            format!("no graphics driver for Vulkan or OpenGL answers ({why}); {DRIVERS}")
        };
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..wgpu::RequestAdapterOptions::default()
        }))
        .map_err(|e| lacks(e.to_string()))?;
        let wishes = wgpu::DeviceDescriptor {
            required_limits: adapter.limits(),
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&wishes)).map_err(|e| lacks(e.to_string()))?;
        Ok(Self {
            device,
            queue,
            name: adapter.get_info().name,
        })
    }

    /// Does what a card may have no memory for.
    ///
    /// # Errors
    /// What the card has against it.
    pub fn trying<R>(&self, work: impl FnOnce() -> Result<R, String>) -> Result<R, String> {
        let scopes = [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation]
            .map(|filter| self.device.push_error_scope(filter));
        let done = work();
        let mut faults = scopes
            .into_iter()
            .rev()
            .map(|scope| pollster::block_on(scope.pop()));
        match faults.find_map(|fault| fault) {
            Some(fault) => Err(format!("{}: {fault}", self.name)),
            None => done,
        }
    }

    /// Waits until all that it was told is done.
    pub fn finish(&self) {
        // It can only fail where the card is lost, and then nothing is to be waited for.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
    }
}
