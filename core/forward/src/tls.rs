//! Encryption of the connections by rustls.
//!
//! The server is identified by its certificate, which must be in date and issued for its name.

use std::path::Path;
use std::sync::Arc;

use platen_plant::SinkUse;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use rustls::{ClientConfig, RootCertStore};

use crate::ForwardError;

/// Returns the settings of a sink; `None` where it uses no encryption.
pub(crate) fn config(sink: &SinkUse) -> Result<Option<ClientConfig>, ForwardError> {
    if !sink.tls {
        return Ok(None);
    }
    let mut roots = RootCertStore::empty();
    match &sink.ca_file {
        Some(path) => {
            for certificate in from_file(path)? {
                roots.add(certificate).map_err(|e| file_error(path, &e.to_string()))?;
            }
        }
        None => {
            let (added, _) = roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
            if added == 0 {
                let message = format!(
                    "sink {}: this computer has no certificates of authorities; name ca_file",
                    sink.name
                );
                return Err(ForwardError::File(message));
            }
        }
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|e| ForwardError::File(format!("sink {}: {e}", sink.name)))?;
    Ok(Some(config.with_root_certificates(roots).with_no_client_auth()))
}

/// Returns the password of a sink, the first line of its file; `None` without a file.
pub(crate) fn password(sink: &SinkUse) -> Result<Option<String>, ForwardError> {
    let Some(path) = &sink.password_file else { return Ok(None) };
    let text = std::fs::read_to_string(path).map_err(|e| file_error(path, &e.to_string()))?;
    match text.lines().next().map(str::trim_end) {
        Some(line) if !line.is_empty() => Ok(Some(line.to_owned())),
        _ => Err(file_error(path, "is empty; write the password on its first line")),
    }
}

fn from_file(path: &Path) -> Result<Vec<CertificateDer<'static>>, ForwardError> {
    let certificates = CertificateDer::pem_file_iter(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    match certificates {
        Ok(certificates) if !certificates.is_empty() => Ok(certificates),
        Ok(_) => Err(file_error(path, "has no certificate in PEM")),
        Err(error) => Err(file_error(path, &error.to_string())),
    }
}

fn file_error(path: &Path, why: &str) -> ForwardError {
    ForwardError::File(format!("{}: {why}", path.display()))
}
