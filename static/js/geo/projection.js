// Degrees to local metres about the airport's reference point, and back.

const A = 6378137.0;
const E2 = 0.00669437999014;
const RAD = Math.PI / 180;

/**
 * A local equirectangular projection on the WGS-84 ellipsoid with the second-order terms that make it agree with the
 * service's azimuthal equidistant frame to centimetres over an airport.
 */
export class Projection {
  /** @param {number} latitude degrees @param {number} longitude degrees, of the reference point */
  constructor(latitude, longitude) {
    this.latitude = latitude;
    this.longitude = longitude;
    const s = Math.sin(latitude * RAD);
    const w = Math.sqrt(1 - E2 * s * s);
    /** radius of curvature east-west, m */
    this.prime = A / w;
    /** radius of curvature north-south, m */
    this.meridian = (A * (1 - E2)) / (w * w * w);
    this.sin = s;
    this.cos = Math.cos(latitude * RAD);
  }

  /**
   * @param {number} lon degrees
   * @param {number} lat degrees
   * @returns {[number, number]} metres east and north
   */
  toLocal(lon, lat) {
    const dLat = (lat - this.latitude) * RAD;
    let dLon = (lon - this.longitude) * RAD;
    if (dLon > Math.PI) dLon -= 2 * Math.PI;
    if (dLon < -Math.PI) dLon += 2 * Math.PI;
    const east = this.prime * dLon * (this.cos - this.sin * dLat);
    const north = this.meridian * dLat + 0.5 * this.prime * this.sin * this.cos * dLon * dLon;
    return [east, north];
  }

  /**
   * @param {number} east m
   * @param {number} north m
   * @returns {[number, number]} longitude and latitude in degrees
   */
  toGeodetic(east, north) {
    let dLat = north / this.meridian;
    let dLon = east / (this.prime * this.cos);
    for (let i = 0; i < 3; i += 1) {
      dLat = (north - 0.5 * this.prime * this.sin * this.cos * dLon * dLon) / this.meridian;
      dLon = east / (this.prime * (this.cos - this.sin * dLat));
    }
    return [this.longitude + dLon / RAD, this.latitude + dLat / RAD];
  }
}
