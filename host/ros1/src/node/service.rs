//! The handle of a provided service.

use std::sync::Arc;

use super::lease::Lease;
use crate::service::provider::Provider;

/// Handle of a service that this node provides. Dropping the handle unregisters the service.
#[derive(Debug)]
#[must_use = "dropping the handle unregisters the service"]
pub struct Service {
    provider: Arc<Provider>,
    _lease: Lease,
}

impl Service {
    pub(crate) fn new(provider: Arc<Provider>, lease: Lease) -> Self {
        Self {
            provider,
            _lease: lease,
        }
    }

    /// Full name of the service after remapping.
    pub fn name(&self) -> &str {
        &self.provider.name
    }
}
